"""What is followed when an object does not come back: another one, if there is one that moves."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from app.arrays import Array, Image
from app.files.names import beside
from app.options.run import Run
from app.pipeline.stages.messages import RECOVERED, Begun, Seen
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.tracked_object import TrackedObject
from reconstruction import ReconstructionError
from reconstruction.mapping.start import Start
from reconstruction.online import Phase
from tracking import TrackingError
from tracking.observation import Observation
from tracking.video import Frame

# Seconds of the source in which only the lost object is looked for. After a cut it may come back with the next one, or when
# a hand before the lens goes; what was covered, or has left the picture, is expected back.
AFTER_CUT_S, AFTER_COVER_S = 2.0, 10.0
AGAIN_S = 1.0  # until the next attempt, when there was nothing to follow
SEEN = 0.5  # of its points another object keeps in sight until it has a model, or it is given up
MOVES_PX = 2.0  # median way of its points, before its frames count: a wall that stands still is only what was behind


class Successor:
    """Looks for another object while one is lost.

    Args:
        config: what holds for the other object.
        lost: the frame in which the object was lost.
        numbers: for the objects that are tried.
        watch: to time it.
        start: begins to make models.
        cut: whether the object was lost in a cut.

    Attributes:
        found: the other object, once it has a model.
    """

    def __init__(
        self, config: Run, lost: Seen, numbers: Iterator[int], watch: Stopwatch, start: Start, *, cut: bool
    ) -> None:
        self.found: TrackedObject | None = None
        self._lost = lost.index
        self._config, self._watch, self._start = config, watch, start
        self._due_s = lost.time_s + (AFTER_CUT_S if cut else AFTER_COVER_S)
        self._numbers = numbers
        self._number: int | None = None  # of the one that is tried
        self._tried: TrackedObject | None = None
        self._moves = False

    @property
    def history(self) -> str:
        """How it came about, in words."""
        assert self.found is not None
        return f"followed since frame {self.found.first.index}, nothing seen of the one before since frame {self._lost}"

    @property
    def expected_px(self) -> Mapping[int, Array | None]:
        """What to follow of it, as `Asked` takes it."""
        return {} if self._number is None else {self._number: self._tried.expected_px if self._tried else None}

    def look(self, seen: Seen, picture: Callable[[], Image]) -> None:
        """See what is in the next frame; what cannot be followed, or gives no model, is given up, and tried again later."""
        if self._number is None:
            if seen.time_s >= self._due_s:
                self._number = next(self._numbers)
            return
        if self._number not in seen.objects:  # it is looked for, or frames before that are still on the way
            return
        try:
            good = self._goes_on(self._number, seen, picture)
        except ReconstructionError:
            good = False
        if not good:
            self._number, self._tried, self._due_s = None, None, seen.time_s + AGAIN_S

    def _goes_on(self, number: int, seen: Seen, picture: Callable[[], Image]) -> bool:
        points = seen.objects[number]
        if isinstance(points, TrackingError):
            return False
        if isinstance(points, Begun):
            first = Frame(seen.index, seen.time_s, picture())
            self._tried = TrackedObject(self._config, number, first, points.points_px, self._watch, self._start)
            self._moves = False
        assert self._tried is not None
        observation = self._tried.follow(points).observation
        if observation.visible.mean() < SEEN:  # as when it is lost
            return False
        self._moves = self._moves or way_px(self._tried, observation) > MOVES_PX
        if self._moves:
            self._tried.shape(seen.index, seen.time_s, observation)
            if self._tried.phase is Phase.TRACKING:
                self.found = self._tried
        return True


def way_px(tracked: TrackedObject, observation: Observation) -> float:
    """How far the points that are seen have come since the first frame: the median, px."""
    way = np.linalg.norm(observation.points_px - tracked.points_px, axis=1)
    return float(np.median(way[observation.visible]))


def options_for_another(config: Run, number: int) -> Run:
    """What was asked for, as far as it goes for another object: texture, true shapes and rest shape are the first one's."""
    output, own = config.output, f"object{number}"
    return replace(
        config,
        rest_shape=config.rest_shape if config.rest_shape in RECOVERED else "auto",
        ground_truth=None,
        texture=None,
        place=None,
        output=replace(
            output,
            tracks_out=output.tracks_out and beside(output.tracks_out, own, overwrite=output.overwrite),
            shapes_out=output.shapes_out and beside(output.shapes_out, own, overwrite=output.overwrite),
        ),
    )
