"""A recording written on another core, a few frames behind the run."""

from collections.abc import Callable, Mapping
from queue import Queue
from threading import Thread
from types import TracebackType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from app.pipeline.parts import Parts, Record, Summary
from reconstruction.settings import Metric
from reconstruction.window.model import Model, ShapeEstimate
from tracking.klt import Observation
from tracking.video import Frame

MOST_WAITING = 64  # calls, some ten frames: then the run waits for the disk


class Behind:
    """Takes what `Parts` takes, and hands it on in the same order; a context manager.

    What goes wrong there is raised at the next call here, and at the end.

    Args:
        parts: what is written to.
    """

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._waiting: Queue[Callable[[], None] | None] = Queue(MOST_WAITING)
        self._error: BaseException | None = None
        self._thread = Thread(target=self._work, name="record", daemon=True)

    def observe(self, frame: Frame, observation: Observation, *, phase: str) -> None:
        """A frame, its tracked points and the run's phase."""
        self._hand_on(lambda: self._parts.observe(frame, observation, phase=phase))

    def model(self, model: Model, texture_bgr: NDArray[np.uint8], texture_px: NDArray[np.float64], metric: Metric) -> None:
        """The model, once it is known."""
        self._hand_on(lambda: self._parts.model(model, texture_bgr, texture_px, metric))

    def estimate(self, index: int, time_s: float, estimate: ShapeEstimate) -> None:
        """One frame's shape and pose."""
        self._hand_on(lambda: self._parts.estimate(index, time_s, estimate))

    def timing(self, index: int, time_s: float, stage_ms: Mapping[str, float]) -> None:
        """Milliseconds that each stage took for one frame, as they are now."""
        now = dict(stage_ms)
        self._hand_on(lambda: self._parts.timing(index, time_s, now))

    def event(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Something that happened, in words."""
        self._hand_on(lambda: self._parts.event(index, time_s, text, level))

    def another(self, record: Record, summary: Summary) -> None:
        """Another object from here on."""
        self._hand_on(lambda: self._parts.another(record, summary))

    def finish(self) -> None:
        """The run is over: everything is written, then the summary."""
        self._drain()
        self._raise()
        self._parts.finish()

    @property
    def words(self) -> dict[str, object]:
        """Where it is, for the summary."""
        return self._parts.words

    def __enter__(self) -> Self:
        self._parts.__enter__()
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._drain()
        self._parts.__exit__(kind, error, trace)
        if error is None:
            self._raise()

    def _hand_on(self, call: Callable[[], None]) -> None:
        self._raise()
        self._waiting.put(call)

    def _drain(self) -> None:
        if self._thread.is_alive():
            self._waiting.put(None)
            self._thread.join()

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _work(self) -> None:
        failed = False
        while (call := self._waiting.get()) is not None:
            if failed:  # nothing more is written, but nobody waits for the queue either
                continue
            try:
                call()
            except BaseException as error:  # raised in the run's own thread
                self._error, failed = error, True
