"""The frame loop: read, track, reconstruct, record."""

from collections import deque
from collections.abc import Generator, Iterator
from itertools import chain
from pathlib import Path
from typing import Literal

from threadpoolctl import threadpool_limits

from app.files.names import RECORDINGS, beside, free_name
from app.files.writing import check_free
from app.options.run import Run
from app.pipeline.final_pass import final_pass
from app.pipeline.map_process import MapProcess
from app.pipeline.prefetch import Prefetch
from app.pipeline.processed import InOrder, Processed, Surface
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.successor import Successor, options_for_another
from app.pipeline.summary import Counts, RunSummary, summary_of
from app.pipeline.tracked_object import FrameShape, TrackedObject
from app.recording.process import RecordingProcess
from app.terminal.errors import UsageError, in_a_line
from app.terminal.interrupts import completed
from app.terminal.progress import Progress
from reconstruction import ReconstructionError
from tracking.guarded import Change, Guarded
from tracking.video import Frame, Video


class Session:
    """A run over a video: one object, and another when that does not come back.

    Args:
        config: what the person asked for.
        progress: where to report.
        record: whether a recording is written under a name of our own, too, if none is given.

    Attributes:
        fps: announced rate of the video, once the frames have begun.
        recordings: the files written so far.
        interrupted: whether the run ends early; whoever sets it ends the run with the next frame.
        summary: once the frames have ended: counts of the whole run, and what came out for the first object.

    Raises:
        UsageError, TrackingError: a file or option that cannot be used.
    """

    summary: RunSummary

    def __init__(self, config: Run, progress: Progress, *, record: bool = True) -> None:
        self._config, self._progress, self._record_unnamed = config, progress, record
        for path in (config.output.out, config.output.tracks_out, config.output.shapes_out):
            check_free(path, overwrite=config.output.overwrite)
        self._watch, self._counts, self._order = Stopwatch(), Counts(), InOrder()
        self._messages: list[str] = []  # of the source, to be recorded with the next frame
        self._surface: Surface | None = None
        self._successor: Successor | None = None
        self.recordings: list[Path] = []
        self.fps, self.interrupted = 0.0, False

    def run(self) -> RunSummary:
        """Process the whole source; an interrupt ends it early, with all so far kept. Raises what `frames` raises."""
        self._order.wanted = False
        deque(self.frames(), maxlen=0)
        return self.summary

    def frames(self) -> Generator[Processed, None, None]:
        """The frames in the source's order, each as soon as its shape is known; an interrupt ends them early.

        Closing the generator ends the run: what it has is recorded and saved.

        Raises:
            UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
        """
        config, output = self._config, self._config.output
        video = Video(
            config.source, *config.frame_range, duration_s=config.duration, drop_late=config.drop_late, log=self._told
        )
        with threadpool_limits(1), video, MapProcess() as self._maps:
            source = iter(video)
            first, second = next(source), next(source, None)
            if second is None:
                raise UsageError(f"{config.source} gives only one frame: give a video, or more --frames")
            self.fps = video.fps
            self._object = self._first_object = TrackedObject(config, first, self._watch, self._maps.begin)
            self._path = output.out or (free_name(RECORDINGS, config.source) if self._record_unnamed else None)
            needed = bool(self._path or output.connect or output.view)
            self._wanted_again = needed or bool(output.shapes_out or config.ground_truth)
            prefetch = Prefetch(chain([second], source))
            with RecordingProcess(needed=needed) as self._recording, self._progress, prefetch as self._prefetch:
                self._watch.start()
                self._progress.expect(video.frame_count)
                self._open_recording(first)
                yield from self._objects(first)

    def _told(self, text: str) -> None:
        """What the source has to tell, in its own thread."""
        self._progress.log(text)
        self._messages.append(text)

    def _objects(self, frame: Frame | None) -> Iterator[Processed]:
        """One object after another, from this frame on."""
        while frame is not None:
            try:
                frame = yield from self._follow(frame)
            except KeyboardInterrupt:
                self.interrupted, frame = True, None
            except GeneratorExit:
                self.interrupted = True
                self._end_object(last=True)
                raise
            self._end_object(last=frame is None)
            if frame is not None:
                self._begin_another(frame)
        yield from self._order.ready()

    def _follow(self, frame: Frame | None) -> Generator[Processed, None, Frame | None]:
        """Follow the object to the end of the source, None, or until another is found: the frame that this begins with."""
        while frame is not None and not self.interrupted:
            if self._successor and self._successor.found:
                return frame
            with completed():
                guarded = self._object.follow(frame)
                if not self._config.drop_late:  # what is fetched early is late
                    self._prefetch.begin(self._object.prepare)
                self._tell_changes(frame, guarded)
                self._reconstruct(frame, guarded)
                if self._config.drop_late:
                    self._prefetch.begin(self._object.prepare)
            yield from self._order.ready()
            with self._watch.time("decode"):
                frame = self._prefetch.fetched()
            with self._watch.time("track"):
                self._prefetch.prepared()
        return None

    def _tell_changes(self, frame: Frame, guarded: Guarded) -> None:
        """Record what the source told, and that the object was lost or found."""
        while self._messages:
            self._recording.tell("event", frame.index, frame.time_s, self._messages.pop(0), "WARN")
        if guarded.change is Change.NONE:
            return
        if guarded.change is Change.LOST:
            config = options_for_another(self._config, self._counts.objects + 1)
            self._successor = Successor(config, frame, self._watch, self._maps.begin, cut=guarded.cut)
        else:
            self._successor = None
        self._note(frame.index, frame.time_s, f"{guarded.change.value} at frame {frame.index}: {guarded.reason}", "WARN")

    def _reconstruct(self, frame: Frame, guarded: Guarded) -> None:
        """Make shapes of a frame's points, and record what is known."""
        tracked, observation = self._object, guarded.observation
        self._counts.add(guarded, lost=tracked.lost)
        self._order.add(frame, observation)
        if tracked.lost and self._surface:
            self._order.end(self._surface)
        phase = tracked.phase
        shapes = tracked.shape(frame, observation)
        if self._successor:
            self._successor.look(frame)
        with self._watch.time("record"):
            self._split_recording(frame)
            self._recording.tell("observe", tracked.recorded(frame), observation, phase=phase.value)
            self._record(shapes)
        self._recording.tell("timing", frame.index, frame.time_s, dict(self._watch.now))
        self._watch.now.clear()
        self._progress.advance(tracked.phase.value, tracked.collected.last_rms_px)

    def _record(self, shapes: list[FrameShape]) -> None:
        """Record shapes; with the first of a model, the model."""
        if shapes and (self._surface is None or self._surface.model is not self._object.reconstruction.model):
            self._begin_surface(shapes[0].index, shapes[0].time_s)
        for shape in shapes:
            index, time_s, estimate = shape.index, shape.time_s, shape.estimate
            self._recording.tell("estimate", index, time_s, estimate)
            if estimate.switch:
                self._note(index, time_s, estimate.switch.at(index), "WARN")
            self._order.shape(index, estimate, self._surface)

    def _begin_surface(self, index: int, time_s: float) -> None:
        """A model of the object is known: record it, and how its rest shape was found."""
        revised = "" if self._surface is None else f"another model from frame {index} on: "
        self._surface = self._object.surface
        for note in self._object.notes:
            self._note(index, time_s, revised + note)
        self._recording.tell("rest", *self._surface.recorded)

    def _end_object(self, *, last: bool) -> None:
        """Record the shapes that are left and the summary, and save the files asked for.

        Raises:
            ReconstructionError: the last object has too few frames for a rest shape, and nobody interrupted it.
        """
        try:
            self._record(self._object.finish())
        except ReconstructionError as error:
            if last and not self.interrupted:
                raise
            self._progress.log(in_a_line(error))
        if last:
            self._order.end(self._surface)
            self._watch.stop()
        if self._wanted_again and not self.interrupted:
            self.interrupted = final_pass(self._object, self._recording, self._progress)
        if last:
            self.summary = self._summary(self._first_object)
        self._recording.tell("summary", self._summary(self._object).as_dict())
        if self._surface is not None:  # its figure would have slowed the run
            model = self._object.reconstruction.model
            self._recording.tell("modes", model.basis, model.mesh, self._object.surface.metric)
        self._object.save()

    def _begin_another(self, frame: Frame) -> None:
        """From this frame on the successor is followed, in a recording of its own."""
        assert self._successor is not None
        assert self._successor.found is not None
        text = f"another object from frame {frame.index} on: {self._successor.history}"
        self._note(frame.index, frame.time_s, text, "WARN")  # where one ends and
        self._object, self._successor, self._surface = self._successor.found, None, None
        self._counts.objects += 1
        self._open_recording(frame)
        self._recording.tell("event", frame.index, frame.time_s, text, "WARN")  # where the other begins
        self._begin_surface(frame.index, frame.time_s)

    def _open_recording(self, frame: Frame) -> None:
        """Write another recording from a frame on: the first, of another object, or the next part of a long one."""
        self._opened_s = frame.time_s
        path, part = self._path, len(self.recordings) + 1
        if path is not None and part > 1:
            path = beside(path, f"part{part}", overwrite=self._config.output.overwrite)
        self.recordings += [path] if path else []
        self._recording.tell("open", path, **self._object.recording_options)

    def _split_recording(self, frame: Frame) -> None:
        """Go on in another file, if it is time."""
        minutes = self._config.output.split_minutes
        if minutes and self._surface and frame.time_s - self._opened_s >= 60.0 * minutes:
            self._recording.tell("summary", self._summary(self._object).as_dict())
            self._open_recording(frame)
            self._recording.tell("rest", *self._surface.recorded)

    def _note(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Tell the person, and record it."""
        self._progress.log(text)
        self._recording.tell("event", index, time_s, text, level)

    def _summary(self, tracked: TrackedObject) -> RunSummary:
        """What is known of the whole run, and of one object."""
        return summary_of(tracked, self._counts, self._watch, self.recordings, interrupted=self.interrupted)
