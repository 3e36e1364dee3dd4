"""The processes that frames wait for, begun: they load, and look for the surface, while the run itself still loads."""

import os
from types import TracebackType
from typing import TYPE_CHECKING, Self

from app.processes.child import child, shared_file
from app.processes.remote import Remote

if TYPE_CHECKING:
    import subprocess
    from multiprocessing.connection import Connection

    from app.options.run import Run


class Launched:
    """Processes at work, or waiting for it; a context manager that ends them.

    Args:
        record: whether there will be a recording.

    Attributes:
        apart: whether there are any: not on a machine with one core, unless they are asked for.
        pictures: the `shared_file` for pictures.
        tracking: a process.
        recording: another, with the connection to it; None before the run begins, and without a recording.
    """

    def __init__(self, *, record: bool = True) -> None:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        self.apart, self._record = False, record
        self.recording: tuple[subprocess.Popen[bytes], Connection] | None = None
        if cores > 1:
            self._launch()

    def begin(self, config: "Run") -> Self:
        """Begin with a run; with one job, without processes."""
        if config.jobs == 1:
            self.close()
        elif config.jobs and not self.apart:
            self._launch()
        if self.apart:
            from app.pipeline.stages.messages import Footage, first_asked

            for message in (Footage.of(config), *first_asked()):
                self.tracking.send(message)
            self.recording = child("app.recording.process", self.pictures) if self._record else None
        return self

    def close(self) -> None:
        """End them."""
        if not self.apart:
            return
        self.apart = False
        self.tracking.close()
        if self.recording:
            process, connection = self.recording
            process.kill()  # one that was used has ended
            process.wait()
            connection.close()
        os.close(self.pictures)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _launch(self) -> None:
        """The process that is waited for first; the others wait until it has what it needs."""
        self.apart, self.pictures = True, shared_file()
        self.tracking = Remote("app.pipeline.stages.tracking_process", "follows the points", self.pictures)


WAITING: list[Launched] = []
"""Begun before the command line is read, which takes as long as they take to load."""


def launched() -> Launched:
    """Those that wait, or new ones."""
    return WAITING.pop() if WAITING else Launched()
