"""What a person can choose of `review`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from app.options.shared import Json, Online, Overwrite


@dataclass(frozen=True)
class Review(Json, Overwrite, Online):
    """What is in a recording: a table, JSON, CSV, a figure, or the viewer; of two recordings side by side.

    As JSON, the facts of two are a list in "recordings".

    Examples:
      modeshape review recordings/demo.rrd
      modeshape review recordings/demo.rrd --plot demo.png --csv demo.csv
      modeshape review recordings/paper.rrd recordings/paper-2.rrd --view
    """

    recording: tyro.conf.Positional[Path]
    """The recording (.rrd); one of a killed run will do."""
    other: tyro.conf.Positional[Path | None] = None
    """Another one to compare it with."""
    csv: Path | None = None
    """Write a row per frame: phase, points seen, lost and recovered, errors, milliseconds, pose, sizes of Λ's rows."""
    plot: Path | None = None
    """Draw errors, points seen, Λ over time, times and eigenvalues as .png, .pdf or .svg."""
    view: bool = False
    """Open the viewer; two recordings are shown side by side."""
    connect: str | None = None
    """Address (host:port) of a running viewer to show it in."""
