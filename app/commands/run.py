"""`modeshape run`: a video, frame by frame."""

from typing import TYPE_CHECKING

from app.options.run import Run
from app.pipeline.stages.launched import launched
from app.terminal.progress import Progress

if TYPE_CHECKING:
    from app.pipeline.summary import RunSummary


def run(command: Run, progress: Progress) -> "RunSummary":
    """Reconstruct and record; returns the summary.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and what helps.
    """
    with launched().begin(command) as processes:
        from app.pipeline.session import Session  # it loads while the processes of the stages do

        return Session(command, progress, launched=processes).run()
