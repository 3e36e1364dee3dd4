"""The processes of the stages, begun: they load, and look for the surface, while the run itself still loads."""

import os
from types import TracebackType
from typing import Self

from app.options.run import Run
from app.pipeline.stages.messages import first_asked
from app.processes.child import child, shared_file
from app.processes.remote import Remote


class Launched:
    """Processes at work, or waiting for it; a context manager that ends them.

    Args:
        config: of the run; with one job, or on a machine with one core, there are none.
        record: whether there will be a recording.

    Attributes:
        apart: whether there are any.
        pictures: the `shared_file` for pictures.
        tracking, maps: processes.
        recording: another, with the connection to it; None without a recording.
    """

    def __init__(self, config: Run, *, record: bool = True) -> None:
        jobs = config.jobs
        if jobs is None:
            jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.apart = jobs > 1
        if not self.apart:
            return
        self.pictures = shared_file()
        self.tracking = Remote("app.pipeline.stages.tracking_process", "follows the points", self.pictures)
        for message in (config, *first_asked()):
            self.tracking.send(message)
        self.recording = child("app.recording.process", self.pictures) if record else None
        self.maps = Remote("app.pipeline.stages.maps", "makes the models")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if not self.apart:
            return
        self.apart = False
        self.tracking.close()
        self.maps.close()
        if self.recording:
            process, connection = self.recording
            process.kill()  # one that was used has ended
            process.wait()
            connection.close()
        os.close(self.pictures)
