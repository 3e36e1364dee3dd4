"""`modeshape demo`: the sample video through the whole pipeline."""

from pathlib import Path

from app.demo import sample
from app.files.names import RECORDINGS
from app.options.run import Demo, Output, Run
from app.pipeline.session import Session
from app.pipeline.summary import RunSummary
from app.terminal.progress import Progress


def demo(config: Demo, progress: Progress) -> RunSummary:
    """Render the sample if it is not there yet, reconstruct it, score it, record it to recordings/demo.rrd."""
    with Progress("rendering the sample video") as rendering:
        made = sample(progress=rendering.at)
    path = Path(RECORDINGS, "demo.rrd")
    run = Run(
        source=str(made.video),
        roi=made.roi,
        ground_truth=made.truth,
        output=Output(out=path, overwrite=True, view=config.view, json=config.json),
    )
    if path.exists():
        progress.log(f"replacing {path}")
    return Session(run, progress).run()
