"""The stages of a run beside the window: in processes of their own where there are cores for them."""

from contextlib import ExitStack
from types import TracebackType
from typing import Self

from app.options.run import Run
from app.pipeline.stages.launched import Launched
from app.pipeline.stages.maps import MapProcess
from app.pipeline.stages.messages import Footage
from app.pipeline.stages.tracking_process import Tracking, TrackingHere, TrackingProcess
from app.recording.process import RecordingHere, RecordingProcess
from reconstruction.mapping.start import Start, at_once


class Stages:
    """The stages; a context manager that ends them.

    Args:
        config: what the person asked for.
        launched: their processes.

    Attributes:
        tracking: reads the source and follows points.
        begin_map: begins to make a model.

    Raises:
        UsageError, TrackingError: the source cannot be read.
    """

    tracking: Tracking
    begin_map: Start

    def __init__(self, config: Run, launched: Launched) -> None:
        self._config, self._launched = config, launched
        self._ends = ExitStack()
        self.begin_map = at_once

    def recording(self, *, needed: bool) -> RecordingHere | RecordingProcess:
        """What writes recordings; a context manager that completes them."""
        if not isinstance(self.tracking, TrackingProcess):
            return RecordingHere(needed=needed)
        begun = self._launched.recording if needed else None
        if begun is None:
            self.tracking.ring.release_all()
        return RecordingProcess(begun, self.tracking.ring)

    def __enter__(self) -> Self:
        with self._ends:  # what has begun ends if another cannot begin
            if self._launched.apart:
                self.begin_map = self._ends.enter_context(MapProcess(waited_for=not self._config.live)).begin
                tracking = TrackingProcess(self._launched.tracking, self._launched.pictures)
                self.tracking = self._ends.enter_context(tracking)
            else:
                self.tracking = self._ends.enter_context(TrackingHere(Footage.of(self._config)))
            self._ends = self._ends.pop_all()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._ends.__exit__(kind, error, trace)
