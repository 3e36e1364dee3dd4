"""One object of a run: its points, who makes shapes of them, and what is kept of it."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from app.arrays import Array, Flags, Image
from app.files.stored_tracks import StoredFrame, StoredTracks
from app.files.track_file import load_truth
from app.files.writing import writable
from app.options.run import Run, configuration
from app.pipeline.estimates import Collected, Scores, save_shapes
from app.pipeline.prepare import estimator
from app.pipeline.processed import FrameShape, Surface
from app.pipeline.quality.ruler import ruler
from app.pipeline.stages.messages import LAG, Begun
from app.pipeline.stopwatch import Stopwatch
from reconstruction.estimate import ShapeEstimate
from reconstruction.mapping.start import Start
from reconstruction.online import Phase
from tracking.guarded import Change, Guarded
from tracking.observation import Observation
from tracking.video import Frame


class TrackedObject:
    """One object, followed from a frame that shows it.

    Args:
        config: what the person asked for.
        number: its own, among the objects of the run.
        first: that frame.
        points_px: (P, 2) its points in it.
        watch: to time it.
        start: begins to make its models.
        frames: so many there will be, if that is known.

    Attributes:
        config, number, first, points_px: the same.
        lost, alike: whether it is lost; share of its points seen so far that looked as in its first frame.
        since, last: frames of the source from which on it has been followed, and that showed it last.
        recordings: the files that it is recorded in.
        reconstruction: its estimator.
        collected, online: its estimates, and as they were shown on the way, if there was another pass (else None).

    Raises:
        UsageError, TrackingError: a mesh or truth that does not fit.
    """

    def __init__(
        self,
        config: Run,
        number: int,
        first: Frame,
        points_px: Array,
        watch: Stopwatch,
        start: Start,
        frames: int | None = None,
    ) -> None:
        self.config, self.number, self.first, self.points_px, self._watch = config, number, first, points_px, watch
        self._truth = load_truth(config.ground_truth) if config.ground_truth else None
        self.collected = self._nothing()
        self.online: Collected | None = None
        self._texture: Image | None = None
        if config.texture:
            from app.painting.picture import first_picture  # what few need

            self._texture = first_picture(config.texture)
        height, width = first.image.shape[:2]
        self.reconstruction = estimator(config, (width, height), points_px, start, frames)
        self.lost, self.alike, self.since, self.last = False, 1.0, first.index, first.index
        self.recordings: list[Path] = []
        self._astray = np.zeros(len(points_px), np.bool_)
        self._times: dict[int, float] = {}  # of frames that have no shape yet: source frame → seconds
        self._stored = StoredTracks(len(points_px)) if config.passes or config.output.tracks_out else None

    @property
    def expected_px(self) -> Array | None:
        """Where its points are expected (P, 2) in the frame that is tracked when it has seen this one."""
        return None if self.lost else self.reconstruction.predict(LAG)

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
            from app.painting.compositing import painted
            from app.painting.placement import Placement, corners_of, outline_of

            placement = Placement(corners_of(self.config.place), self.config.opacity, outline_of(self.config.outline))
            seen = painted(seen, self.points_px, model, self._texture, placement)
        return Surface(self.first, self.points_px, model, metric, seen)

    @property
    def recording_options(self) -> dict[str, object]:
        """What a `Recording` of it takes beside the path."""
        output, (height, width) = self.config.output, self.first.image.shape[:2]
        return {
            "configuration": configuration(self.config),
            "size": (width, height),
            "image": output.image,
            "color": output.color,
            "video": Path(self.config.source),
            "overwrite": output.overwrite,
            "keep_online": output.keep_online and self.config.passes,
            "final_pass": self.config.passes,
        }

    def come_back(self, index: int) -> None:
        """It is followed again from a frame on, after another object was."""
        self.since, self.lost = index, False
        self.reconstruction.restart()

    def follow(self, seen: Begun | Guarded) -> Guarded:
        """What the next frame shows of it."""
        if isinstance(seen, Begun):
            return Guarded(Observation(self.points_px, np.ones(len(self.points_px), np.bool_)))
        if seen.astray is not None:
            self._astray |= seen.astray
        if seen.change is not Change.NONE:
            self.lost = seen.change is Change.LOST
        self.alike = self.alike if self.lost else seen.observation.alike
        if seen.change is Change.RECOVERED:  # nothing ties it to where it was
            self.reconstruction.restart()
        return seen

    def shape(self, index: int, time_s: float, observation: Observation) -> list[FrameShape]:
        """The shapes known with a frame of the source, oldest first; none of it while the object is lost.

        Raises:
            ReconstructionError: no rest shape can be had.
        """
        if self._stored is not None:
            self._stored.add(StoredFrame(index, time_s, observation, self.lost))
        if self.lost:
            self.collected.lose(index)
            return self._of_frames(self.reconstruction.catch_up())
        self._times[index], self.last = time_s, index
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
        stored = self._stored if self.config.passes else None
        if stored is None or not self.reconstruction.revise(
            self._on_surface(one.observation) for one in stored if not one.lost
        ):
            return
        before, lost = self.collected, False
        self.online, self.collected = before, self._nothing()
        try:
            for one in stored.told_ahead(lambda some: self.reconstruction.foresee([*map(self._on_surface, some)])):
                if one.lost:
                    self.collected.lose(one.index)
                    lost = True
                    continue
                if lost:
                    self.reconstruction.restart()
                    lost = False
                self._times[one.index] = one.time_s
                yield from self._of_frames(self.reconstruction.update(*self._on_surface(one.observation)))
        except BaseException:  # not all frames: those of before are complete
            self.online, self.collected = None, before
            raise

    def _on_surface(self, seen: Observation) -> tuple[Array, Flags]:
        """Points (2, P) px, and which of them are seen (P,) and on the surface."""
        return seen.points_px.T, seen.visible & ~self._astray

    def score(self, collected: Collected | None) -> Scores | None:
        """Errors of estimates against the truth; None without one, or before there is a shape."""
        rest = self.reconstruction.rest
        if self._truth is None or rest is None or collected is None:
            return None
        result = collected.score_against(self._truth, rest.motion.shape, self.reconstruction.model.mesh)
        return Scores.of(result) if result else None

    @property
    def mm_per_px(self) -> float | None:
        """Millimetres in a pixel of the first frame, if a length is known."""
        known, rest = self.collected.ruler, self.reconstruction.rest
        return known.mm_per_px(along=rest is None or rest.kind != "rigid") if known else None

    def true_shapes(self) -> dict[int, Array]:
        """The truth (n, 3) by source frame, where its shapes are; nothing without one, or before there is a shape."""
        rest = self.reconstruction.rest
        if self._truth is None or rest is None:
            return {}
        return self.collected.true_shapes(self._truth, rest.motion.shape, self.reconstruction.model.mesh)

    def save(self) -> None:
        """Write the files asked for.

        Raises:
            UsageError: one cannot be written.
        """
        with ExitStack() as both:  # one that cannot be written does not keep the other from being
            both.callback(self._save_shapes)
            both.callback(self._save_tracks)

    def _save_tracks(self) -> None:
        path, stored, camera = self.config.output.tracks_out, self._stored, self.reconstruction.camera
        if path and stored is not None:
            with writable(path) as file:
                stored.save(file, camera.K if camera.perspective else None)

    def _save_shapes(self) -> None:
        path, collected = self.config.output.shapes_out, self.collected
        if path and collected.estimates:
            save_shapes(path, collected.estimates, self.reconstruction.model, collected.lost, self.mm_per_px or 1.0)

    def _nothing(self) -> Collected:
        """No estimates yet."""
        truth_frames = frozenset(self._truth.frames.tolist()) if self._truth else frozenset()
        ends = None if self.config.between is None else np.reshape(self.config.between, (2, 2))
        size_mm = None if self.number else self.config.size_mm  # nobody knows another object's
        known = None if size_mm is None else ruler(size_mm, ends, self.points_px)
        return Collected(self.config.output.shapes_out is not None, truth_frames, ruler=known)

    def _of_frames(self, estimates: list[ShapeEstimate]) -> list[FrameShape]:
        """Estimates with the oldest frames that wait for one."""
        shapes = []
        for index, estimate in zip([*self._times], estimates, strict=False):
            shapes.append(FrameShape(index, self._times.pop(index), estimate))
            self.collected.add(index, estimate)
        return shapes
