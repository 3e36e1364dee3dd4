"""What a person can choose of `modes`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import tyro

from app.options.shared import FromTracks, Json, Overwrite
from app.terminal.errors import UsageError


@dataclass(frozen=True)
class Modes(Json, Overwrite, FromTracks):
    """Draw the mode shapes of a rest shape: the leading modes in and out of the plane, and the eigenvalues.

    A recording shows the modes it was made with. For tracks, rest shape and modes are found as by `evaluate`,
    with the options below.

    Examples:
      modeshape modes recordings/demo.rrd --out modes.png
      modeshape modes tracks.npz --rest-shape first-truth --metric manhattan
    """

    ESSENTIAL: ClassVar = (
        "source",
        "out",
        "columns",
        "rest_shape",
        "metric",
        "modes",
        "camera",
        "focal",
        "overwrite",
        "json",
    )

    source: tyro.conf.Positional[Path]
    """A recording (.rrd) or tracks (.npz, .mat)."""
    out: Path = Path("modes.png")
    """The figure, a PNG."""
    columns: int = 5
    """Modes shown."""

    def __post_init__(self) -> None:
        if not 1 <= self.columns <= 12:
            raise UsageError(f"--columns {self.columns} does not fit: give 1 to 12")
        if self.out.suffix.lower() != ".png":
            raise UsageError(f"--out {self.out} is no PNG: let it end in .png")
