"""What a person can choose of `retexture`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import ClassVar

import tyro

from app.options.run import Output, Run, Source
from app.options.shared import Json, Overwrite


@dataclass(frozen=True, kw_only=True)
class Retexture(Json, Overwrite, Source):
    """Put a picture or a video on the moving surface in a recording, a video file, or live in what a camera sees.

    A file is painted once all of it has been reconstructed. The picture lies in the scene's light, and behind what is in
    front of the surface; after a cut to another scene, frames stay as they are. The options of `run` are only for videos,
    but for --frames, --place and --opacity. Of a sheet whose --corners are told, it reaches to the edge.

    Examples:
      modeshape retexture recordings/demo.rrd --texture poster.png --out poster.mp4
      modeshape retexture paper.mp4 --roi 195 95 325 265 --texture logo.png --place 250 160 90 60 --out logo.webm
      modeshape retexture paper.mp4 --corners 172 77 573 107 568 398 143 365 --texture poster.png --out poster.mp4
    """

    ESSENTIAL: ClassVar = (
        *(
            "source",
            "texture",
            "out",
            "place",
            "place_frame",
            "opacity",
            "roi",
            "corners",
            "mask",
            "frames",
            "focal",
            "rrd",
            "view",
        ),
        *("json", "overwrite"),
    )

    source: tyro.conf.Positional[str]
    """A recording (.rrd), or what `run` takes: video file, image pattern, camera index or URL."""
    texture: Path
    """Picture (transparent where it has alpha) or video."""
    out: Path
    """The new video: .mp4 (H.264) or .webm (VP9)."""
    rrd: Path | None = None
    """Also keep a recording; only for videos."""
    place_frame: int | None = None
    """The frame that --place is told in, by its number in the source; without it the first."""
    view: bool = False
    """Open the viewer and watch live; only for videos."""

    @property
    def run(self) -> Run:
        """The run that goes with it."""
        shared = {field.name: getattr(self, field.name) for field in fields(Source)}
        output = Output(out=self.rrd, overwrite=self.overwrite, view=self.view, json=self.json)
        return Run(**shared, texture=self.texture, output=output)
