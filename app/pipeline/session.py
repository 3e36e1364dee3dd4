"""The frame loop: read, track, reconstruct, record."""

from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from time import perf_counter

from threadpoolctl import threadpool_limits

from app.files.writing import check_free
from app.options.run import Run, Words, as_words
from app.painting.compositing import Placement, painted
from app.painting.picture import first_picture
from app.pipeline.behind import Behind
from app.pipeline.counts import Tally
from app.pipeline.interrupts import completed
from app.pipeline.observer import Followed, Observer
from app.pipeline.parts import RECORDINGS, Parts, free_name
from app.pipeline.prefetch import Ahead
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.successor import Successor, for_another
from app.pipeline.tracked_object import Settled, Take
from app.recording.recorder import Recorder
from app.terminal.errors import UsageError, in_a_line
from app.terminal.progress import Progress
from reconstruction import ReconstructionError
from tracking.guarded import Change, Guarded
from tracking.klt import Observation
from tracking.video import Frame, Video


class Session:
    """One run of the pipeline over a video: one object, and another when that does not come back.

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
        for path in (config.output.out, config.output.tracks_out, config.output.shapes_out):
            check_free(path, overwrite=config.output.overwrite)
        self._watch = Stopwatch()
        self._tally = Tally()
        self._successor: Successor | None = None
        self._heard: list[str] = []  # from the source, to be told with the next frame
        self._interrupted = self._modelled = False
        self._started = self._elapsed_s = 0.0

    def run(self) -> Words:
        """Process the whole source; an interrupt ends it early, with everything so far kept.

        Returns:
            the summary: counts of the whole run, and what came out for the first object.

        Raises:
            UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
        """
        config, output = self._config, self._config.output
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
            self._fps, self._size = video.fps, video.size
            self._take = take = Take(config, first, self._watch)
            path = output.out
            if path is None and self._observer is None:
                path = free_name(RECORDINGS, config.source)
            split_s = None if output.split_minutes is None else 60.0 * output.split_minutes
            record, summary = partial(self._record, config), partial(self._summary, take)
            parts = Parts(path, record, summary, split_s, overwrite=output.overwrite)
            with Behind(parts) as self._recording, self._progress:
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
        self._take.save()
        return self._summary(take)

    def _record(self, config: Run, path: Path | None) -> Recorder:
        """A recording of an object, or a part of it."""
        output = config.output
        return Recorder(
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
        frame: Frame | None = first
        with Ahead(frames, lambda frame: self._take.begin(frame)) as ahead:
            while frame is not None:
                with completed():
                    if self._successor and self._successor.take:
                        self._go_on_with(self._successor.take, self._successor.lost, frame)
                    guarded = self._take.follow(frame)
                    if not self._config.drop_late:  # what is fetched early is late
                        ahead.begin()
                    self._tell(frame, guarded)
                    self._step(frame, guarded.observation)
                    if self._config.drop_late:
                        ahead.begin()
                with self._watch.time("decode"):
                    frame = ahead.fetched()
                with self._watch.time("track"):
                    ahead.prepared()

    def _tell(self, frame: Frame, guarded: Guarded) -> None:
        """Say what the source said, and that the object was lost or found."""
        while self._heard:
            self._recording.event(frame.index, frame.time_s, self._heard.pop(0), "WARN")
        if guarded.change is Change.NONE:
            return
        if guarded.change is Change.LOST:
            self._tally.losses += 1
            config = for_another(self._config, self._tally.objects + 1)
            self._successor = Successor(config, frame, self._watch, cut=guarded.cut)
        else:
            self._tally.recoveries += 1
            self._successor = None
        text = f"{guarded.change.value} at frame {frame.index}: {guarded.reason}"
        self._recording.event(frame.index, frame.time_s, text, "WARN")
        self._progress.say(text)

    def _step(self, frame: Frame, observation: Observation) -> None:
        take = self._take
        self._tally.add(observation, lost=take.lost)
        self._followed.add(frame, observation)
        if take.lost and self._modelled:
            self._followed.end()
        phase = take.phase
        settled = take.shape(frame, observation)
        if self._successor:
            self._successor.look(frame)
        with self._watch.time("record"):
            self._recording.observe(frame, observation, phase=phase.value)
            self._settle(settled)
        self._recording.timing(frame.index, frame.time_s, self._watch.now)
        self._watch.now.clear()
        self._progress.advance(take.phase.value, take.collected.last_rms_px)

    def _settle(self, settled: list[Settled]) -> None:
        """Record shapes; with the first of them, the model."""
        if settled and not self._modelled:
            self._record_model(settled[-1].index, settled[-1].time_s)
        for one in settled:
            self._recording.estimate(one.index, one.time_s, one.estimate)
            if one.estimate.switch:
                self._recording.event(one.index, one.time_s, one.estimate.switch.at(one.index), "WARN")
                self._progress.say(one.estimate.switch.at(one.index))
            self._followed.shape(one.index, one.estimate)

    def _go_on_with(self, take: Take, lost: Frame, frame: Frame) -> None:
        """From this frame on another object is followed: what there is of the one before is complete."""
        try:
            self._settle(self._take.finish())
        except ReconstructionError as error:  # it was lost before its bootstrap was over
            self._progress.say(in_a_line(error))
        self._take.save()
        text = (
            f"another object from frame {frame.index} on: followed since frame {take.first.index}, "
            f"nothing seen of the one before since frame {lost.index}"
        )
        self._progress.say(text)
        self._recording.event(frame.index, frame.time_s, text, "WARN")  # where one ends and
        self._recording.another(partial(self._record, take.config), partial(self._summary, take))
        self._recording.event(frame.index, frame.time_s, text, "WARN")  # where the other begins
        self._take, self._successor = take, None
        self._tally.objects += 1
        self._record_model(frame.index, frame.time_s)

    def _finish(self) -> None:
        """Settle for what the bootstrap has; an interrupted one may have too little, and the run is kept all the same."""
        try:
            settled = self._take.finish()
        except ReconstructionError as error:
            if not self._interrupted:
                raise
            self._progress.say(in_a_line(error))
            return
        with self._watch.time("record"):
            self._settle(settled)

    def _record_model(self, index: int, time_s: float) -> None:
        """Everything about the model, and a word on how its rest shape was found."""
        take, reconstruction = self._take, self._take.reconstruction
        rest, model = reconstruction.rest, reconstruction.model
        assert rest is not None
        assert reconstruction.metric is not None
        for note in filter(None, (rest.note, reconstruction.focal_note)):
            self._recording.event(index, time_s, note)
            self._progress.say(note)
        first = take.first.image
        if self._picture is not None and take.config.texture:
            placement = Placement(self._config.place, self._config.opacity)
            first = painted(first, take.points_px, model, self._picture, placement)
        self._recording.model(model, first, take.points_px, reconstruction.metric)
        if self._observer:
            self._observer.begin(take.first, take.points_px, model, self._fps)
        self._modelled = True

    def _summary(self, take: Take) -> Words:
        """What is known of the whole run, and of one object."""
        frames, elapsed_s = self._tally.frames, self._elapsed_s or perf_counter() - self._started
        return {
            "source": self._config.source,
            "frames": frames,
            "interrupted": self._interrupted,
            **take.words,
            **self._tally.words,
            "fps": frames / elapsed_s,
            "stage_ms": {stage: total / max(frames, 1) for stage, total in self._watch.total.items()},
            **self._recording.words,
        }
