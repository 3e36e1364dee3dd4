"""A recording in parts, each complete in itself: for runs of hours and days, and since each has one model only."""

from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from app.recording.recorder import Recorder
from reconstruction.settings import Metric
from reconstruction.window.model import Model, ShapeEstimate
from tracking.klt import Observation
from tracking.video import Frame

RECORDINGS = Path("recordings")

Record = Callable[[Path | None], Recorder]
Summary = Callable[[], Mapping[str, object]]


class Parts:
    """Writes like a `Recording`, and goes on in another file now and then; a context manager.

    Args:
        path: of the first part; the others are numbered. None writes none.
        record: opens a recording of that path.
        summary: what is known of the run by now, told at the end of each part.
        split_s: seconds of video in a part; None for one part an object.
        overwrite: whether files of the numbered parts' names are replaced; else other names are found.
    """

    def __init__(
        self,
        path: Path | None,
        record: Record,
        summary: Summary,
        split_s: float | None = None,
        *,
        overwrite: bool = False,
    ) -> None:
        self.path, self._record, self._summary = path, record, summary
        self._split_s, self._overwrite = split_s, overwrite
        self._recording = record(path)
        self._parts, self._last = 1, path
        self._began_s: float | None = None
        self._model: tuple[Model, NDArray[np.uint8], NDArray[np.float64], Metric] | None = None

    def observe(self, frame: Frame, observation: Observation, *, phase: str) -> None:
        """A frame, its tracked points and the run's phase; from here on in another file, if it is time."""
        if self._began_s is None:
            self._began_s = frame.time_s
        if self._split_s is not None and self._model is not None and frame.time_s - self._began_s >= self._split_s:
            self._began_s = frame.time_s
            self._recording.summary(self._summary())
            self._next()
            self._tell_model()
        self._recording.observe(frame, observation, phase=phase)

    def model(self, model: Model, texture_bgr: NDArray[np.uint8], texture_px: NDArray[np.float64], metric: Metric) -> None:
        """The model, once it is known; `texture_px` (p, 2) are its vertices' pixels in `texture_bgr`."""
        self._model = model, texture_bgr, texture_px, metric
        self._tell_model()

    def estimate(self, index: int, time_s: float, estimate: ShapeEstimate) -> None:
        """One frame's shape and pose."""
        self._recording.estimate(index, time_s, estimate)

    def timing(self, index: int, time_s: float, stage_ms: Mapping[str, float]) -> None:
        """Milliseconds that each stage took for one frame."""
        self._recording.timing(index, time_s, stage_ms)

    def event(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Something that happened, in words."""
        self._recording.event(index, time_s, text, level)

    def another(self, record: Record, summary: Summary) -> None:
        """Another object from here on, in another file, opened and ended by these; its model comes next."""
        self.finish()
        self._record, self._summary = record, summary
        self._began_s = self._model = None
        self._next()

    def finish(self) -> None:
        """The object's run is over: the summary, and the figure of the modes, which would have slowed the run."""
        self._recording.summary(self._summary())
        if self._model is not None:
            model, _, _, metric = self._model
            self._recording.modes(model.basis, model.mesh, metric)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._recording.__exit__(kind, error, trace)

    @property
    def words(self) -> dict[str, object]:
        """Where it is, for the summary."""
        if self.path is None:
            return {}
        parts = {"parts": self._parts, "last_part": str(self._last)} if self._parts > 1 else {}
        return {"recording": str(self.path)} | parts

    def _next(self) -> None:
        self._recording.close()
        self._parts += 1
        if self.path is not None:
            self._last = beside(self.path, f"part{self._parts}", overwrite=self._overwrite)
        self._recording = self._record(self._last)

    def _tell_model(self) -> None:
        assert self._model is not None
        model, image, points_px, _ = self._model
        self._recording.rest(
            model.basis, model.mesh.faces, model.mesh.edges, model.camera, texture_bgr=image, texture_px=points_px
        )


def free_name(folder: Path, source: str) -> Path:
    """A recording's path named after its source that does not exist yet: NAME.rrd, NAME-2.rrd, …"""
    stem = Path(source.split("?")[0]).stem.replace("%", "") or "video"
    return free(folder / f"{f'camera{stem}' if source.isdigit() else stem}.rrd")


def beside(path: Path, what: str, *, overwrite: bool) -> Path:
    """NAME-WHAT beside a file NAME, numbered if that exists and may not be replaced."""
    other = path.with_name(f"{path.stem}-{what}{path.suffix}")
    return other if overwrite else free(other)


def free(path: Path) -> Path:
    """The first of NAME, NAME-2, … that does not exist."""
    numbered = (path.with_name(f"{path.stem}{f'-{n}' if n > 1 else ''}{path.suffix}") for n in count(1))
    return next(one for one in numbered if not one.exists())
