"""One object of a run: its points, who follows them, who makes shapes of them, and what is kept of it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.files.stored_tracks import StoredFrame, StoredTracks
from app.files.writing import writable
from app.options.run import Run, configuration
from app.painting.compositing import Placement, painted
from app.painting.picture import first_picture
from app.pipeline.estimates import Collected, Scores, save_shapes
from app.pipeline.prepare import prepared
from app.pipeline.processed import Surface
from app.pipeline.stopwatch import Stopwatch
from reconstruction.estimate import ShapeEstimate
from reconstruction.mapping.mapper import Start
from reconstruction.online import Phase
from tracking.guarded import Change, Guarded, GuardedTracker
from tracking.klt import Observation
from tracking.tracks import Tracks, Truth
from tracking.video import Frame

NO_PICTURE = np.empty((0, 0, 3), np.uint8)


@dataclass(frozen=True)
class FrameShape:
    """The shape of a frame of the source."""

    index: int
    time_s: float
    estimate: ShapeEstimate


class TrackedObject:
    """One object, followed from a frame that shows it.

    Args:
        config: what the person asked for.
        first: that frame.
        watch: to time it.
        start: where its models are made.

    Attributes:
        config, first: the same.
        points_px: (P, 2) its points in the first frame.
        reconstruction: its estimator.
        collected: its estimates.
        online: its estimates as they were shown on the way, if there was another pass; else None.

    Raises:
        UsageError, TrackingError: a region, mask, mesh or truth that does not fit, or too few corners.
    """

    def __init__(self, config: Run, first: Frame, watch: Stopwatch, start: Start) -> None:
        self.config, self.first, self._watch = config, first, watch
        self._truth = Truth.load(config.ground_truth) if config.ground_truth else None
        self.collected = self._nothing()
        self.online: Collected | None = None
        self._texture = first_picture(config.texture) if config.texture else None
        self.points_px, self.reconstruction = prepared(config, first, start)
        self._tracker = GuardedTracker(first.image, self.points_px)
        self._times: dict[int, float] = {}  # of frames that have no shape yet: source frame → seconds
        stored = config.passes or config.output.tracks_out
        self._stored = StoredTracks(len(self.points_px)) if stored else None

    @property
    def lost(self) -> bool:
        """Whether the object is lost."""
        return self._tracker.lost

    @property
    def phase(self) -> Phase:
        """What is being done about it."""
        return Phase.LOST if self.lost else self.reconstruction.phase

    @property
    def notes(self) -> list[str]:
        """How rest shape and focal length were found, in words."""
        rest = self.reconstruction.rest
        return [note for note in (rest.note if rest else "", self.reconstruction.focal_note) if note]

    @property
    def surface(self) -> Surface:
        """What its shapes are of; there once the bootstrap is over."""
        metric = self.reconstruction.metric
        assert metric is not None
        model, seen = self.reconstruction.model, self.first.image
        if self._texture is not None:
            placement = Placement(self.config.place, self.config.opacity)
            seen = painted(seen, self.points_px, model, self._texture, placement)
        return Surface(self.first, self.points_px, model, metric, seen)

    @property
    def recording_options(self) -> dict[str, object]:
        """What a `Recording` of it takes beside the path."""
        output, (height, width) = self.config.output, self.first.image.shape[:2]
        return {
            "configuration": configuration(self.config),
            "size": (width, height),
            "connect": output.connect,
            "view": output.view,
            "image": output.image,
            "video": Path(self.config.source),
            "overwrite": output.overwrite,
            "keep_online": output.keep_online and self.config.passes,
        }

    def recorded(self, frame: Frame) -> Frame:
        """What its recording needs of a frame: the picture is left out if it is not stored."""
        return frame if self.config.output.image == "jpeg" else replace(frame, image=NO_PICTURE)

    def prepare(self, frame: Frame) -> None:
        """Do what can be done early with the next frame, in another thread."""
        self._tracker.begin(frame.image)

    def follow(self, frame: Frame) -> Guarded:
        """Find the points in the next frame, or in the first."""
        if frame is self.first:
            return Guarded(Observation(self.points_px, np.ones(len(self.points_px), np.bool_)))
        with self._watch.time("track"):
            guarded = self._tracker.track(frame.image, self.reconstruction.predict())
        if guarded.change is Change.RECOVERED:  # nothing ties it to where it was
            self.reconstruction.restart()
        return guarded

    def shape(self, frame: Frame, observation: Observation) -> list[FrameShape]:
        """The shapes known with this frame, oldest first; none of it while the object is lost.

        Raises:
            ReconstructionError: no rest shape can be had.
        """
        if self._stored is not None:
            self._stored.add(StoredFrame(frame.index, frame.time_s, observation, self.lost))
        if self.lost:
            self.collected.lose(frame.index)
            return self._of_frames(self.reconstruction.catch_up())
        self._times[frame.index] = frame.time_s
        with self._watch.time("reconstruct"):
            return self._of_frames(self.reconstruction.update(observation.points_px.T, observation.visible))

    def finish(self) -> list[FrameShape]:
        """The shapes of the frames that still wait: no more frames come.

        Raises:
            ReconstructionError: it has too little.
        """
        with self._watch.time("reconstruct"):
            return self._of_frames(self.reconstruction.finish())

    def revised(self) -> Iterator[FrameShape]:
        """The shapes of all frames once more, with a last map; none where that tells nothing new."""
        if not self.config.passes or not self.reconstruction.revise():
            return
        assert self._stored is not None
        self.online, self.collected = self.collected, self._nothing()
        lost = False
        for stored in self._stored:
            if stored.lost:
                self.collected.lose(stored.index)
                lost = True
                continue
            if lost:
                self.reconstruction.restart()
                lost = False
            self._times[stored.index] = stored.time_s
            seen = stored.observation
            yield from self._of_frames(self.reconstruction.update(seen.points_px.T, seen.visible))

    def score(self, collected: Collected | None) -> Scores | None:
        """Errors of estimates against the truth; None without one, or before there is a shape."""
        rest = self.reconstruction.rest
        if self._truth is None or rest is None or collected is None:
            return None
        result = collected.score_against(self._truth, rest.motion.shape, self.reconstruction.model.mesh)
        return Scores.of(result) if result else None

    def save(self) -> None:
        """Write the files asked for.

        Raises:
            UsageError: one cannot be written.
        """
        output = self.config.output
        if output.tracks_out and self._stored is not None:
            tracks = [stored.observation for stored in self._stored]
            W, visible = np.stack([o.points_px.T for o in tracks]), np.stack([o.visible for o in tracks])
            camera = self.reconstruction.camera
            with writable(output.tracks_out) as file:
                Tracks(W, visible, K=camera.K if camera.perspective else None).save(file)
        if output.shapes_out and self.collected.estimates:
            save_shapes(output.shapes_out, self.collected.estimates, self.reconstruction.model, self.collected.lost)

    def _nothing(self) -> Collected:
        """No estimates yet."""
        truth_frames = frozenset(self._truth.frames.tolist()) if self._truth else frozenset()
        return Collected(self.config.output.shapes_out is not None, truth_frames)

    def _of_frames(self, estimates: list[ShapeEstimate]) -> list[FrameShape]:
        """Estimates with the oldest frames that wait for one."""
        shapes = []
        for estimate in estimates:
            index = next(iter(self._times))
            shapes.append(FrameShape(index, self._times.pop(index), estimate))
            self.collected.add(index, estimate)
        return shapes
