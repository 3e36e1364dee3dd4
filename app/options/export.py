"""What a person can choose of `export`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import tyro

from app.options.shared import Json, Online, Overwrite
from app.terminal.errors import UsageError


@dataclass(frozen=True)
class Export(Json, Overwrite, Online):
    """A recording as files for other programs, from the .rrd alone.

    Formats:
      glb    animated mesh with texture for Blender and every glTF viewer: the modes are morph targets. y up, right-handed;
             the rest shape is 1 m long, or as --size-mm of the run had it; its first place is the origin, time 0 the
             first frame
      usdz   the same as a USD package, with the points of every frame (`pip install 'modeshape[usd]'`)
      obj    a folder with frame_000123.obj for each frame, one material and texture; axes: --axes
      ply    the same as PLY
      csv    a folder: points.csv (seen, projected, in 3-D), frames.csv (pose and camera path), lambda.csv, mesh.csv
      npz    the arrays of `run --shapes-out`, and observed and projected points, times, camera path
      mp4    the video with mesh, points and reprojections drawn over it (H.264)
      webm   the same as VP9

    Axes and units:
      camera axes (csv, npz, obj, ply): x right, y down, z forward, as the camera sees
      y-up axes (glb, usdz; obj and ply with --axes y-up): x right, y up, z towards the viewer
      unit (all but glb, usdz): a pixel of the first frame, in depth too, since an uncalibrated camera has no metres

    Examples:
      modeshape export recordings/demo.rrd --format glb
      modeshape export recordings/demo.rrd --format obj --axes y-up --out sheet_obj
      modeshape export recordings/demo.rrd --out demo.webm
    """

    ESSENTIAL: ClassVar = ("recording", "format", "out", "axes", "color")

    recording: tyro.conf.Positional[Path]
    """The recording (.rrd); one of a killed run will do."""
    format: Literal["glb", "usdz", "obj", "ply", "csv", "npz", "mp4", "webm"] | None = None
    """What to write; without it, what the ending of --out says."""
    out: Path | None = None
    """File, or folder for obj, ply and csv; without it beside the recording and named after it."""
    axes: Literal["camera", "y-up"] = "camera"
    """Of obj and ply."""
    color: Literal["picture", "strain", "curvature"] = "picture"
    """Of glb and usdz: the first frame, or the greatest strain or curvature of each vertex, of either sign, in colours."""

    def __post_init__(self) -> None:
        ending = self.out.suffix.lower().lstrip(".") if self.out else ""
        single = ("glb", "usdz", "npz", "mp4", "webm")
        if self.format is None and ending not in single:
            raise UsageError("no format: give --format glb, usdz, obj, ply, csv, npz, mp4 or webm")
        if self.color != "picture" and self.kind not in ("glb", "usdz"):
            raise UsageError(
                f"--color {self.color} is of glb and usdz: the others have strain and curvature as numbers, or a picture"
            )
        if self.format in single and self.out and ending != self.format:
            raise UsageError(f"--out {self.out} does not fit --format {self.format}: let it end in .{self.format}")

    @property
    def kind(self) -> str:
        """The format, given or told by the ending."""
        return self.format or (self.out.suffix.lower().lstrip(".") if self.out else "")
