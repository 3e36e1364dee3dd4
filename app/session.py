"""The frame loop: read, track, reconstruct, record."""

from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from app.ahead import Ahead
from app.artwork import first_picture
from app.behind import Behind
from app.compositing import Laid, painted
from app.config import Run, Words, as_words
from app.errors import UsageError
from app.interrupts import completed
from app.observer import Followed, Observer
from app.parts import RECORDINGS, Parts, free_name
from app.prepare import prepared
from app.progress import Progress
from app.recording import Recording
from app.results import Collected, check_free, save_shapes, score_words
from app.stopwatch import Stopwatch
from app.tally import Tally
from reconstruction import ReconstructionError
from reconstruction.model import ShapeEstimate
from reconstruction.online import Phase
from tracking.guarded import Change, Guarded, GuardedTracker
from tracking.klt import Observation
from tracking.tracks import Tracks, Truth
from tracking.video import Frame, Video


class Session:
    """One run of the pipeline over a video.

    Args:
        config: what the person asked for.
        progress: where to report.
        observer: who else wants to know; with one, a recording is written only if its name is given.

    Raises:
        UsageError, TrackingError: a file or option that cannot be used.
    """

    def __init__(self, config: Run, progress: Progress, observer: Observer | None = None) -> None:
        self._config, self._progress, self._observer = config, progress, observer
        self._picture = first_picture(config.texture) if config.texture else None
        self._followed = Followed(observer)
        output = config.output
        for path in (output.tracks_out, output.shapes_out):
            check_free(path, overwrite=output.overwrite)
        self._truth = Truth.load(config.ground_truth) if config.ground_truth else None
        truth_frames = frozenset(self._truth.frames.tolist()) if self._truth else frozenset()
        self._collected = Collected(output.shapes_out is not None, truth_frames)
        self._watch = Stopwatch()
        self._times: dict[int, float] = {}  # of frames that have no shape yet: source frame → seconds
        self._tally = Tally(listing=output.shapes_out is not None)
        self._tracks: list[Observation] = []
        self._heard: list[str] = []  # from the source, to be told with the next frame
        self._interrupted = self._modelled = False
        self._started = self._elapsed_s = 0.0

    def run(self) -> Words:
        """Process the whole source; an interrupt ends it early, with everything so far kept.

        Returns:
            the summary.

        Raises:
            UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
        """
        config = self._config
        video = Video(
            config.source, *config.frame_range, duration_s=config.duration, drop_late=config.drop_late, say=self._hear
        )
        with threadpool_limits(1), video:
            frames = iter(video)
            first, second = next(frames), next(frames, None)
            if second is None:
                raise UsageError(
                    f"{config.source} gives only one frame: a shape shows in how it moves; give a video, or more --frames"
                )
            self._first, self._fps, self._size = first, video.fps, video.size
            self._points_px, self._reconstruction = prepared(config, first)
            path = config.output.out
            if path is None and self._observer is None:
                path = free_name(RECORDINGS, config.source)
            split_s = None if config.output.split_minutes is None else 60.0 * config.output.split_minutes
            with Behind(Parts(path, self._record, self._summary, split_s)) as self._recording, self._progress:
                self._started = perf_counter()
                try:
                    self._progress.expect(video.frame_count)
                    self._loop(first, chain([second], frames))
                except KeyboardInterrupt:
                    self._interrupted = True
                self._finish()
                self._followed.end()
                self._elapsed_s = perf_counter() - self._started
                self._recording.finish()
        self._save()
        return self._summary()

    def _record(self, path: Path | None) -> Recording:
        """A recording of this run, or of a part of it."""
        config, output = self._config, self._config.output
        return Recording(
            path,
            configuration=as_words(config),
            size=self._size,
            connect=output.connect,
            view=output.view,
            image=output.image,
            video=Path(config.source),
            overwrite=output.overwrite,
        )

    def _hear(self, text: str) -> None:
        """What the source has to say, in its own thread."""
        self._progress.say(text)
        self._heard.append(text)

    def _loop(self, first: Frame, frames: Iterator[Frame]) -> None:
        with self._watch.time("track"):
            tracker = GuardedTracker(first.image, self._points_px)
        guarded = Guarded(Observation(self._points_px, np.ones(len(self._points_px), bool)))
        frame: Frame | None = first
        with Ahead(frames, lambda frame: tracker.begin(frame.image)) as ahead:
            while frame is not None:
                with completed():
                    if self._tally.frames:
                        with self._watch.time("track"):
                            guarded = tracker.track(frame.image, self._reconstruction.predict())
                    if not self._config.drop_late:  # what is fetched early is late
                        ahead.begin()
                    self._tell(frame, guarded)
                    self._step(frame, guarded.observation, lost=tracker.lost)
                    if self._config.drop_late:
                        ahead.begin()
                with self._watch.time("decode"):
                    frame = ahead.fetched()
                with self._watch.time("track"):
                    ahead.prepared()

    def _tell(self, frame: Frame, guarded: Guarded) -> None:
        """Say what the source said, and that the surface was lost or found; then nothing ties it to where it was."""
        while self._heard:
            self._recording.event(frame.index, frame.time_s, self._heard.pop(0), "WARN")
        if guarded.change is Change.NONE:
            return
        if guarded.change is Change.LOST:
            self._tally.losses += 1
        else:
            self._tally.recoveries += 1
            self._reconstruction.restart()
        text = f"{guarded.change.value} at frame {frame.index}: {guarded.reason}"
        self._recording.event(frame.index, frame.time_s, text, "WARN")
        self._progress.say(text)

    def _step(self, frame: Frame, observation: Observation, *, lost: bool) -> None:
        self._tally.add(frame.index, observation, lost=lost)
        if self._config.output.tracks_out:
            self._tracks.append(observation)
        self._followed.add(frame, observation)
        phase = Phase.LOST if lost else self._reconstruction.phase
        estimates: list[ShapeEstimate] = []
        if lost:  # no shape is better than a wrong one
            if self._modelled:
                self._followed.end()
        else:
            self._times[frame.index] = frame.time_s
            with self._watch.time("reconstruct"):
                estimates = self._reconstruction.update(observation.points_px.T, observation.visible)
        with self._watch.time("record"):
            self._recording.observe(frame, observation, phase=phase.value)
            self._settle(estimates)
        self._recording.timing(frame.index, frame.time_s, self._watch.now)
        self._watch.now.clear()
        self._progress.advance(phase.value if lost else self._reconstruction.phase.value, self._collected.last_rms_px)

    def _settle(self, estimates: list[ShapeEstimate]) -> None:
        """Record the shapes of the oldest frames that wait for one; with the first of them, the model."""
        if estimates and not self._modelled:
            self._record_model()
        for estimate in estimates:
            index, time_s = next(iter(self._times.items()))
            del self._times[index]
            self._collected.add(index, estimate)
            self._recording.estimate(index, time_s, estimate)
            self._followed.shape(index, estimate)

    def _finish(self) -> None:
        """Settle for what the bootstrap has; an interrupted one may have too little, and the run is kept all the same."""
        try:
            with self._watch.time("reconstruct"):
                estimates = self._reconstruction.finish()
        except ReconstructionError as error:
            if not self._interrupted:
                raise
            self._progress.say(str(error))
            return
        with self._watch.time("record"):
            self._settle(estimates)

    def _record_model(self) -> None:
        """Everything about the model, and a word on how its rest shape was found."""
        rest, model = self._reconstruction.rest, self._reconstruction.model
        assert rest is not None
        index = next(reversed(self._times))
        for note in filter(None, (rest.note, self._reconstruction.focal_note)):
            self._recording.event(index, self._times[index], note)
            self._progress.say(note)
        first = self._first.image
        if self._picture is not None:
            laid = Laid(self._config.place, self._config.opacity)
            first = painted(first, self._points_px, model, self._picture, laid)
        self._recording.model(model, first, self._points_px, self._config.model.metric)
        if self._observer:
            self._observer.begin(self._first, self._points_px, model, self._fps)
        self._modelled = True

    def _summary(self) -> Words:
        config, rest, frames = self._config, self._reconstruction.rest, self._tally.frames
        elapsed_s = self._elapsed_s or perf_counter() - self._started
        words: Words = {
            "source": config.source,
            "frames": frames,
            "interrupted": self._interrupted,
            "points": len(self._points_px),
            "rest_shape": rest.kind if rest else None,
            "rest_shape_note": rest.note if rest else None,
            "bootstrap_frames": self._reconstruction.bootstrap_frames,
            "deformation": self._reconstruction.deformation,
            **self._reconstruction.focal_words,
            **self._tally.words,
            "reprojection_rms_px": self._collected.reprojection_rms_px,
            "fps": frames / elapsed_s,
            "stage_ms": {stage: total / max(frames, 1) for stage, total in self._watch.total.items()},
        }
        if self._truth and rest:
            rest_points, mesh = rest.motion.shape, self._reconstruction.model.mesh
            words |= score_words(self._collected.score_against(self._truth, rest_points, mesh))
        return words | self._recording.words

    def _save(self) -> None:
        output = self._config.output
        if output.tracks_out and self._tracks:
            W = np.stack([o.points_px.T for o in self._tracks])
            visible = np.stack([o.visible for o in self._tracks])
            camera = self._reconstruction.camera
            Tracks(W, visible, K=camera.K if camera.perspective else None).save(output.tracks_out)
        if output.shapes_out and self._collected.estimates:
            save_shapes(output.shapes_out, self._collected.estimates, self._reconstruction.model, self._tally.lost)
