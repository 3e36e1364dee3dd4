"""`modeshape run`: a video, frame by frame."""

from app.options.run import Run
from app.pipeline.session import Session
from app.pipeline.summary import RunSummary
from app.terminal.progress import Progress


def run(command: Run, progress: Progress) -> RunSummary:
    """Reconstruct and record; returns the summary.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and what helps.
    """
    return Session(command, progress).run()
