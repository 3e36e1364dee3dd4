"""What a person can choose of `bench`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path

from app.options.shared import Json, Overwrite
from app.terminal.errors import UsageError


@dataclass(frozen=True)
class Bench(Json, Overwrite):
    """How fast: window step, basis and whole runs, beside SciPy, Ceres, modal analysis and a bare OpenCV loop.

    Ceres takes part where pyceres is installed: pip install 'modeshape[bench]'.

    Examples:
      modeshape bench --quick
      modeshape bench --plot bench.png --readme README.md
    """

    quick: bool = False
    """The ratios alone, on fewer sizes and frames: about a minute instead of a quarter of an hour."""
    plot: Path | None = None
    """Draw times against the number of points as .png, .pdf or .svg."""
    readme: Path | None = None
    """Write the table of ratios into this file, between its two marks."""

    def __post_init__(self) -> None:
        if self.plot is not None and self.plot.suffix.lower() not in (".png", ".pdf", ".svg"):
            raise UsageError(f"--plot {self.plot} is no picture: give a name that ends in .png, .pdf or .svg")
