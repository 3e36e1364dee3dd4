"""What is followed when an object does not come back: another one, if there is one that moves."""

from dataclasses import replace

import numpy as np

from app.files.names import beside
from app.options.run import Run
from app.pipeline.prepare import RECOVERED
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.tracked_object import TrackedObject
from reconstruction import ReconstructionError
from reconstruction.mapping.mapper import Start
from reconstruction.online import Phase
from tracking import TrackingError
from tracking.klt import Observation
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
        cut: whether that was a cut.
        watch: to time it.
        start: where models are made.

    Attributes:
        lost: the same.
        found: the other object, once it has a model.
    """

    def __init__(self, config: Run, lost: Frame, watch: Stopwatch, start: Start, *, cut: bool) -> None:
        self.lost = lost
        self.found: TrackedObject | None = None
        self._config, self._watch, self._start = config, watch, start
        self._due_s = lost.time_s + (AFTER_CUT_S if cut else AFTER_COVER_S)
        self._tried: TrackedObject | None = None
        self._moves = False

    @property
    def history(self) -> str:
        """How it came about, in words."""
        assert self.found is not None
        return (
            f"followed since frame {self.found.first.index}, nothing seen of the one before since frame {self.lost.index}"
        )

    def look(self, frame: Frame) -> None:
        """See what is in the next frame; what cannot be followed, or gives no model, is given up, and tried again later."""
        if self._tried is None and frame.time_s < self._due_s:
            return
        try:
            if self._tried is None:
                with self._watch.time("track"):
                    self._tried, self._moves = TrackedObject(self._config, frame, self._watch, self._start), False
            good = self._goes_on(self._tried, frame)
        except (TrackingError, ReconstructionError):
            good = False
        if not good:
            self._tried, self._due_s = None, frame.time_s + AGAIN_S

    def _goes_on(self, tried: TrackedObject, frame: Frame) -> bool:
        observation = tried.follow(frame).observation
        if observation.visible.mean() < SEEN:  # as when it is lost
            return False
        self._moves = self._moves or way_px(tried, observation) > MOVES_PX
        if self._moves:
            tried.shape(frame, observation)
            if tried.phase is Phase.TRACKING:
                self.found = tried
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
            image="jpeg" if output.image == "video" else output.image,  # the video file is in the first part
        ),
    )
