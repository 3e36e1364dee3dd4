"""The frame loop: read, track, reconstruct, record."""

from collections import deque
from collections.abc import Generator, Iterator
from contextlib import ExitStack
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Literal

from threadpoolctl import threadpool_limits

from app.files.names import RECORDINGS, free_name
from app.options.run import Run
from app.pipeline.final_pass import final_pass
from app.pipeline.others import Others
from app.pipeline.parts import Parts
from app.pipeline.prepare import check_files
from app.pipeline.processed import FrameShape, InOrder, Processed, Surface
from app.pipeline.stages.launched import Launched
from app.pipeline.stages.messages import Seen
from app.pipeline.stages.stages import Stages
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.summary import Counts, RunSummary, summary_of
from app.pipeline.tracked_object import TrackedObject
from app.terminal.errors import UsageError, in_a_line
from app.terminal.interrupts import completed, undisturbed
from app.terminal.progress import Progress
from reconstruction import ReconstructionError
from tracking.guarded import Change, Guarded
from tracking.video import Frame


class Session:
    """A run over a video: one object, and when that does not come back, another, or one that was followed before.

    Args:
        config: what the person asked for.
        progress: where to report.
        record: whether a recording is written under a name of our own, too, if none is given.
        launched: the stages' processes, if they have been begun already.

    Attributes:
        fps, recordings: announced rate of the video, once the frames have begun; the files written so far.
        interrupted: whether the run ends early; whoever sets it ends the run with the next frame.
        summary: once the frames have ended: counts of the whole run, and what came of the first object.

    Raises:
        UsageError, TrackingError: a file or option that cannot be used.
    """

    summary: RunSummary

    def __init__(self, config: Run, progress: Progress, *, record: bool = True, launched: Launched | None = None) -> None:
        self._launched, self._config, self._progress, self._record_unnamed = launched, config, progress, record
        check_files(config)
        self._watch, self._counts, self._order = Stopwatch(), Counts(), InOrder()
        self._surface: Surface | None = None
        self.recordings, self.fps, self.interrupted = list[Path](), 0.0, False

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
        output = self._config.output
        needed = bool(self._record_unnamed or output.out or output.watched)
        self._wanted_again = needed or bool(output.shapes_out or self._config.ground_truth)
        launched = self._launched or Launched(record=needed).begin(self._config)
        with threadpool_limits(1), launched, Stages(self._config, launched) as stages:
            self._tracking, self._begin_map, self.fps = stages.tracking, stages.begin_map, stages.tracking.opened.fps
            first, second = self._tracking.receive(), self._tracking.receive()
            if first is None or second is None:
                raise UsageError(f"{self._config.source} gives only one frame: give a video, or more --frames")
            self._object = self._first_object = self._begun(first)
            self._others = Others(self._config, self._watch, self._begin_map)
            path = output.out or (free_name(RECORDINGS, self._config.source) if self._record_unnamed else None)
            with stages.recording(needed=needed) as self._recording, self._progress:
                self._watch.start()
                self._progress.expect(self._tracking.opened.frame_count)
                self._parts = Parts(self._recording, path, output, self._tracking.opened.kept[0], self._progress.log)
                self.recordings = self._parts.paths
                self._open_part(first)
                self._recording.tell("region", first.index, first.time_s, first.begun(0).outline)
                yield from self._objects(chain([first, second], iter(self._tracking.receive, None)))

    def _begun(self, seen: Seen) -> TrackedObject:
        """The first object. Raises the error if there is none."""
        first = Frame(seen.index, seen.time_s, self._tracking.picture(seen.number, keep=True))
        frames, points_px = self._tracking.opened.frame_count, seen.begun(0).points_px
        return TrackedObject(self._config, 0, first, points_px, self._watch, self._begin_map, frames)

    def _objects(self, source: Iterator[Seen]) -> Iterator[Processed]:
        """The frames of one object after another."""
        try:
            for seen in source:
                if instead := self._others.instead(seen, self._object):
                    self._end_object(last=False)
                    self._go_on_with(*instead, seen)
                with completed():
                    self._process(seen)
                yield from self._order.ready()
                if self.interrupted:
                    break
        except KeyboardInterrupt:
            self.interrupted = True
        except ReconstructionError:
            self._save(last=True)
            raise
        except BaseException:  # nobody wants more; the source or a stage has ended, a disk is full, or it is our mistake
            self.interrupted = True
            self._end_object(last=True)
            raise
        self._end_object(last=True)
        yield from self._order.ready()

    def _process(self, seen: Seen) -> None:
        """Make shapes of a frame's points, record what is known, and ask for another frame."""
        tracked = self._object
        self._split_recording(seen)
        guarded = tracked.follow(seen.points(tracked.number))
        frame = Frame(seen.index, seen.time_s, self._tracking.picture(seen.number, keep=self._order.wanted))
        self._tell_changes(seen, guarded)
        self._counts.add(guarded, lost=tracked.lost)
        self._order.add(frame, guarded.observation)
        phase = tracked.phase
        shapes = tracked.shape(seen.index, seen.time_s, guarded.observation)
        self._others.look(seen, partial(self._tracking.picture, seen.number, keep=True))
        self._tracking.send(self._others.asked(seen, tracked))  # as early as can be: it is waited for
        with self._watch.time("record"):
            self._recording.observe(frame, seen.number, guarded.observation, phase=phase.value)
            self._record(shapes)
        if tracked.lost and self._surface:
            self._order.end(self._surface)
        if shapes and shapes[-1].index == seen.index and len(shapes) == 1:  # no frames have waited for a model
            self._watch.arrived(seen.read_s)
        self._watch.add(seen.stage_ms)
        self._recording.tell("timing", seen.index, seen.time_s, dict(self._watch.now))
        self._watch.now.clear()
        self._progress.advance(tracked.phase.value, tracked.collected.last_rms_px)

    def _tell_changes(self, seen: Seen, guarded: Guarded) -> None:
        """Record what the source told, and that the object was lost or found."""
        for text in seen.told:
            self._note(seen.index, seen.time_s, text, "WARN")
        if guarded.change is Change.NONE:
            return
        if guarded.change is Change.LOST:
            self._others.lost(seen, self._counts.objects, cut=guarded.cut)
        else:
            self._others.recovered()
        self._note(seen.index, seen.time_s, f"{guarded.change.value} at frame {seen.index}: {guarded.reason}", "WARN")

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

        Raises a ReconstructionError where the last object has no rest shape, a UsageError where a stage has ended.
        """
        try:
            try:
                with completed():
                    self._record(self._object.finish())
            except KeyboardInterrupt:
                self.interrupted = True
            except (ReconstructionError, UsageError) as error:
                if last and not self.interrupted:
                    self.interrupted = isinstance(error, UsageError)
                    raise
                self._progress.log(in_a_line(error))
            if last:
                self._order.end(self._surface)
                self._watch.stop()
            if self._wanted_again and not self.interrupted:
                self.interrupted = final_pass(self._object, self._recording, self._progress)
        finally:
            with undisturbed():
                self._save(last=last)

    def _save(self, *, last: bool) -> None:
        """Record the summary of what is known; at last, write the files asked for. A run that failed leaves nothing."""
        if self._surface is None and last and not self.interrupted:
            return
        with ExitStack() as files:  # are written, whatever the rest fails at
            if last:
                files.callback(self._others.save)
            files.callback(self._others.keep, self._object)
            self.summary = self._summary(self._first_object)
            self._recording.tell("summary", self._summary(self._object).as_dict())
            if self._surface is not None:
                self._recording.tell("modes", *self._object.surface.recorded[:2])
                self._recording.tell("truth", self._object.true_shapes())

    def _go_on_with(self, tracked: TrackedObject, text: str, frame: Seen) -> None:
        """From this frame on another object is followed, in a recording of its own."""
        self._note(frame.index, frame.time_s, text, "WARN")  # where one ends and
        self._counts.objects += tracked.since == tracked.first.index  # not one that comes back
        self._object, self._surface = tracked, None
        self._open_part(frame)
        self._recording.tell("event", frame.index, frame.time_s, text, "WARN")  # where the other begins
        self._begin_surface(frame.index, frame.time_s)

    def _split_recording(self, frame: Seen) -> None:
        """Go on in another file, if it is time, and no frame of this one waits for its shape."""
        if self._surface and not self._object.reconstruction.behind and self._parts.due(frame.time_s):
            self._recording.tell("summary", self._summary(self._object).as_dict())
            self._recording.tell("modes", *self._surface.recorded[:2])
            self._open_part(frame)
            self._recording.tell("rest", *self._surface.recorded)

    def _open_part(self, frame: Seen) -> None:
        """Record the object in another file from this frame on."""
        self._parts.open(frame.time_s, self._object.recording_options)
        self._object.recordings += self._parts.paths[-1:]

    def _note(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Tell the person, and record it."""
        self._progress.log(text)
        self._recording.tell("event", index, time_s, text, level)

    def _summary(self, tracked: TrackedObject) -> RunSummary:
        """What is known of the whole run, and of one object."""
        return summary_of(tracked, self._counts, self._watch, self.recordings, interrupted=self.interrupted)
