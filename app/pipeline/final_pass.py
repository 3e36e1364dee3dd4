"""All frames of an object once more, with what it turned out to be."""

from app.pipeline.tracked_object import TrackedObject
from app.recording.process import Recorder
from app.terminal.interrupts import completed
from app.terminal.progress import Progress


def final_pass(tracked: TrackedObject, recording: Recorder, progress: Progress) -> bool:
    """Record all frames of an object again, if a map of its keyframes tells what it is; whether there was an interrupt.

    An interrupt waits for the end: a recording has one model for all its frames.
    """
    told = tracked.notes
    try:
        with completed():
            for count, shape in enumerate(tracked.revised()):
                if count == 0:
                    recording.tell("final_pass")
                    for note in tracked.notes if tracked.notes != told else ():
                        progress.log(note)
                        recording.tell("event", shape.index, shape.time_s, note)
                    recording.tell("rest", *tracked.surface.recorded)
                if shape.index < tracked.since:  # in a file that is complete: another object has been followed since
                    continue
                recording.tell("estimate", shape.index, shape.time_s, shape.estimate)
                progress.advance("final pass", tracked.collected.last_rms_px)
    except KeyboardInterrupt:
        return True
    return False
