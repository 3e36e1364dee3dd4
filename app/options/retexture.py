"""What a person can choose of `retexture`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass, fields
from pathlib import Path

import tyro

from app.options.run import Output, Run, Source, check_laid


@dataclass(frozen=True, kw_only=True)
class Retexture(Source):
    """Put a picture or a video on the moving surface in a recording, or live in a video while it is tracked.

    It lies in the scene's light, and behind what is in front of the surface. When a video being tracked cuts to
    another scene, frames stay as they are. The options from --roi on are those of `run` and only for videos, but for
    --frames.

    Examples:
      modeshape retexture recordings/demo.rrd --texture poster.png --out poster.mp4
      modeshape retexture paper.mp4 --roi 195 95 325 265 --texture logo.png --place 250 160 90 60 --out logo.webm
    """

    source: tyro.conf.Positional[str]
    """A recording (.rrd), or what `run` takes: video file, image pattern, camera index or URL."""
    texture: Path
    """Picture (transparent where it has alpha) or video."""
    out: Path
    """The new video: .mp4, or .webm for browsers."""
    place: tuple[int, int, int, int] | None = None
    """Where the picture lies in the first frame: X Y WIDTH HEIGHT in pixels; without it over the whole mesh."""
    opacity: float = 1.0
    """Of the picture, 0 to 1."""
    rrd: Path | None = None
    """Also keep a recording; only for videos."""
    view: bool = False
    """Open the viewer and watch live; only for videos."""
    overwrite: bool = False
    """Replace existing files."""
    json: bool = False
    """Print the summary as JSON on stdout."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_laid(self.place, self.opacity)

    @property
    def run(self) -> Run:
        """The run that goes with it."""
        shared = {field.name: getattr(self, field.name) for field in fields(Source)}
        output = Output(out=self.rrd, overwrite=self.overwrite, view=self.view, json=self.json)
        return Run(**shared, texture=self.texture, place=self.place, opacity=self.opacity, output=output)
