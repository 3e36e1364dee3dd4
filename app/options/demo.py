"""What a person can choose of `demo`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass

from app.options.shared import Json


@dataclass(frozen=True)
class Demo(Json):
    """Render the sample video, reconstruct it, score it against its truth and record it to recordings/demo.rrd."""

    view: bool = False
    """Open the viewer and watch live."""
