"""What a person can choose of `pick` and `frame`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from app.options.shared import Json, Overwrite
from app.terminal.errors import UsageError


@dataclass(frozen=True)
class Pick(Json):
    """Draw the region on a page in the browser: a rectangle, a polygon, or the four corners of a sheet.

    Prints the command that reconstructs it, and does so with --run. The page is served to this machine alone. Of a video,
    any frame may be chosen to begin with; of a camera, a picture is taken after a countdown.

    Examples:
      modeshape pick paper.mp4
      modeshape pick paper.mp4 --run --options="--image none --view"
      modeshape pick 0 --run
    """

    source: tyro.conf.Positional[str]
    """Video file, image pattern (img%04d.png), camera index or URL."""
    run: bool = False
    """Reconstruct it as soon as it is drawn."""
    options: str = ""
    """Options of `run`, quoted, after an equals sign."""
    frame: int = 0
    """The frame shown first."""
    port: int = 0
    """Of the page's address; without it any that is free."""
    open: bool = True
    """Open the page in the browser; its address is printed in any case."""

    def __post_init__(self) -> None:
        if self.frame < 0:
            raise UsageError(f"--frame {self.frame} is no frame: give 0 and more")


@dataclass(frozen=True)
class FramePicture(Json, Overwrite):
    """A frame of a video as a picture, with a grid of pixels to read a region from.

    Examples:
      modeshape frame paper.mp4 --out frame.png
      modeshape frame paper.mp4 --number 120 --grid 100 --out frame.png
    """

    source: tyro.conf.Positional[str]
    """Video file, image pattern (img%04d.png), camera index or URL."""
    out: Path = Path("frame.png")
    """The picture: .png or .jpg."""
    number: int = 0
    """The frame, counted from 0."""
    grid: int = 50
    """Pixels from line to line; 0 for no grid."""

    def __post_init__(self) -> None:
        if self.number < 0:
            raise UsageError(f"--number {self.number} is no frame: give 0 and more")
        if self.grid and self.grid < 5:
            raise UsageError(f"--grid {self.grid} hides the picture: give 5 and more, or 0 for none")
        if self.out.suffix.lower() not in (".png", ".jpg", ".jpeg"):
            raise UsageError(f"--out {self.out} is no picture: let it end in .png or .jpg")
