"""The stages of a run beside the window: in processes of their own where there are cores for them."""

import os
from contextlib import ExitStack
from types import TracebackType
from typing import Self

from app.options.run import Run
from app.pipeline.stages.maps import MapProcess
from app.pipeline.stages.tracking_process import Tracking, TrackingHere, TrackingProcess
from app.processes.ring import shared_file
from app.recording.process import RecordingHere, RecordingProcess
from reconstruction.mapping.mapper import Start, at_once


class Stages:
    """The stages; a context manager that ends them.

    Args:
        config: what the person asked for.

    Attributes:
        tracking: reads the source and follows points.
        begin_map: begins to make a model.

    Raises:
        UsageError, TrackingError: the source cannot be read.
    """

    tracking: Tracking
    begin_map: Start

    def __init__(self, config: Run) -> None:
        self._config = config
        self._ends = ExitStack()
        self.begin_map = at_once

    def recording(self, *, needed: bool) -> RecordingHere | RecordingProcess:
        """What writes recordings; a context manager that completes them."""
        if not isinstance(self.tracking, TrackingProcess):
            return RecordingHere(needed=needed)
        return RecordingProcess(needed=needed, pictures=self.tracking.ring, file=self._file)

    def __enter__(self) -> Self:
        with self._ends:  # what has begun ends if another cannot begin
            if apart(self._config.jobs):
                self._file = shared_file()
                self._ends.callback(os.close, self._file)
                self.begin_map = self._ends.enter_context(MapProcess()).begin
                self.tracking = self._ends.enter_context(TrackingProcess(self._config, self._file))
            else:
                self.tracking = self._ends.enter_context(TrackingHere(self._config))
            self._ends = self._ends.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._ends.__exit__(kind, error, trace)


def apart(jobs: int | None) -> bool:
    """Whether stages get processes of their own: asked for, or there are cores."""
    if jobs is None:
        jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return jobs > 1
