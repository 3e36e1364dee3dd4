"""What a person can choose of `run` and `demo`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from app.options.model import Model, priors_text
from app.options.shared import FinalPass, Json, Overwrite
from app.terminal.errors import UsageError

NARROWEST = 16  # px, of pictures that are stored
FEWEST_POINTS = 20  # of which a map is made


@dataclass(frozen=True)
class Output(Json, Overwrite):
    """Where results go."""

    out: Path | None = None
    """The recording; without it recordings/NAME.rrd, numbered if that exists."""
    tracks_out: Path | None = None
    """Save the tracked points as .npz: W (F, 2, P), visible (F, P); those of later objects in NAME-object2.npz, …"""
    shapes_out: Path | None = None
    """Save the shapes as .npz: S (F, 3, P) camera axes, R, s, t, Lambda, faces, visible; those of later objects in
    NAME-object2.npz, …"""
    split_minutes: float | None = None
    """Start another recording after so many minutes of video: NAME.rrd, NAME-part2.rrd, … Each is complete in itself; there
    is no final pass then. With another object, one is started in any case."""
    keep_online: bool = False
    """Keep the shapes as they were shown on the way in the recording, too: beside those of the final pass."""
    image: Literal["jpeg", "video", "none"] = "jpeg"
    """How frames are stored in the recording: each as JPEG, the video file as it is, or not at all."""
    image_width: int | None = None
    """Of the JPEGs, at most, px; without it, those of pictures 2560 px wide and more are at most 1920. Overlays of a
    recording, and videos painted from it, are as sharp as that."""
    color: Literal["depth", "strain", "curvature"] = "depth"
    """What the mesh is coloured by in the view from the side: depth (with --uncertainty, that), strain (red is 5 % longer
    than at rest), or curvature (red bulges to the camera, blue is hollow)."""
    view: bool = False
    """Open the viewer and watch live."""
    serve: bool = False
    """Watch live in a browser of this machine, without a screen here or through a tunnel."""
    connect: str | None = None
    """Address (host:port) of a running viewer to watch live in."""

    @property
    def watched(self) -> bool:
        """Whether somebody watches."""
        return bool(self.connect or self.serve or self.view)

    def __post_init__(self) -> None:
        if self.image_width is not None and not (self.image == "jpeg" and self.image_width >= NARROWEST):
            raise UsageError(f"--image-width goes with --image jpeg, and is {NARROWEST} or more")
        if self.split_minutes is not None:
            if not self.split_minutes > 0:
                raise UsageError(f"--split-minutes {self.split_minutes} is no time: give more than 0")
            if self.image == "video":
                raise UsageError("--split-minutes does not go with --image video: use --image jpeg")


@dataclass(frozen=True)
class Source:
    """What is reconstructed from: the options that `run` and `retexture` share."""

    source: tyro.conf.Positional[str]
    """Video file, image pattern (img%04d.png), camera index or URL."""
    roi: tuple[int, int, int, int] | None = None
    """Region with the surface in the first frame: X Y WIDTH HEIGHT in pixels; without it, the whole frame is searched."""
    polygon: tuple[float, ...] | None = None
    """Region with the surface in the first frame by its corners: X1 Y1 X2 Y2 X3 Y3 … in pixels."""
    corners: tuple[float, float, float, float, float, float, float, float] | None = None
    """The four corners of a sheet in the first frame, going round: X1 Y1 X2 Y2 X3 Y3 X4 Y4 in pixels; a region that knows
    the sheet's outline."""
    search: bool = True
    """Look for the surface in the region, by what moves together in the first frames; without it, all of it is taken."""
    mask: Path | None = None
    """Picture of the video's size, white where the surface is in the first frame."""
    frames: Annotated[str, tyro.conf.arg(metavar="A:B")] = ":"
    """Frames A to B-1 of the source."""
    duration: float | None = None
    """Stop so many seconds after the first frame."""
    drop_late: bool = False
    """Of a camera or stream, leave out frames that nobody had time for within 50 ms."""
    full_size: bool = False
    """Follow points in the pictures as they are, and record those; without it, copies of those 2560 px wide and more.
    Pixels of the results are the pictures' either way."""
    points: int = 800
    """Most points tracked."""
    rest_shape: Annotated[str, tyro.conf.arg(metavar="auto|solid|sheet|rigid|plane|PATH")] = "auto"
    """What it is: found out (auto) or told (solid, sheet), by all frames; by the first ones alone (a turning object:
    rigid; a flat sheet: plane); or a mesh file."""
    camera: Literal["perspective", "orthographic"] = "perspective"
    """How the picture came about."""
    place: tuple[float, ...] | None = None
    """Where --texture lies in the first frame: X Y WIDTH HEIGHT in pixels, or X1 Y1 … X4 Y4, its top left, top right,
    bottom right and bottom left; without it over the whole surface, along its sides."""
    opacity: float = 1.0
    """Of --texture, 0 to 1."""
    size_mm: float | None = None
    """A known length of the surface in millimetres, which makes all that comes out millimetres: of its longest side, or
    --between two places; along a sheet, as a tape lies on it."""
    between: tuple[float, float, float, float] | None = None
    """What --size-mm is the length of: X1 Y1 X2 Y2, two places in the first frame, px."""
    jobs: int | None = None
    """1: do everything in one process, one thing after the other. Without it, each stage has a process of its own where
    there are cores for it; the shapes are the same."""
    model: tyro.conf.OmitArgPrefixes[Model] = field(default_factory=Model)

    def __post_init__(self) -> None:
        if self.jobs is not None and self.jobs < 1:
            raise UsageError(f"--jobs {self.jobs} is too few: give 1 and more")
        if self.points < FEWEST_POINTS:
            few = f"a surface cannot be told from {self.points} points"
            raise UsageError(f"--points {self.points} is too few: {few}; give {FEWEST_POINTS} and more, best 300 to 1000")
        if self.corners is not None and self.polygon is not None:
            raise UsageError("--corners and --polygon are two regions: give one of them")
        if self.polygon is not None and (len(self.polygon) < 6 or len(self.polygon) % 2):
            raise UsageError("--polygon needs three corners and more: give X1 Y1 X2 Y2 X3 Y3 …")
        if self.corners is not None and not convex(self.corners):
            raise UsageError("--corners are not those of a sheet: give its four corners, going round it")
        if self.duration is not None and not 0 < self.duration < float("inf"):
            raise UsageError(f"--duration {self.duration} is no time: give seconds, more than 0")
        if self.size_mm is not None and not 0 < self.size_mm < float("inf"):
            raise UsageError(f"--size-mm {self.size_mm} is no length: give millimetres, more than 0")
        if self.size_mm is not None and self.camera == "orthographic":
            raise UsageError("--size-mm needs a camera in perspective: leave --camera orthographic out")
        if self.between is not None and (self.size_mm is None or self.between[:2] == self.between[2:]):
            raise UsageError("--between goes with --size-mm, the length between two different places: --size-mm 297")
        if self.place is not None and not placeable(self.place):
            told = " ".join(f"{number:g}" for number in self.place)
            raise UsageError(
                f"--place {told} has no area: give X Y WIDTH HEIGHT, both sizes 1 and more, or four corners, going round"
            )
        if not 0 <= self.opacity <= 1:
            raise UsageError(f"--opacity {self.opacity} is no opacity: give 0 to 1")

    @property
    def outline(self) -> tuple[float, ...] | None:
        """The corners x, y, x, y, … px of a region that is no rectangle; None if it has none."""
        return self.corners or self.polygon

    @property
    def frame_range(self) -> tuple[int, int | None]:
        """First frame, and the one after the last or None."""
        return parse_range(self.frames)


@dataclass(frozen=True)
class Run(FinalPass, Source):
    """Reconstruct a video, frame by frame, and record it.

    After a cut to a scene that the object is not in, another object is followed there, in a recording of its own
    (NAME-part2.rrd, …): 2 s after a cut, 10 s after it was covered or left the picture. The summary is about the first.

    Examples:
      modeshape run paper.mp4 --roi 195 95 325 265
      modeshape run 0 --view                        # the first camera, live
      modeshape run http://camera.local/mjpeg --drop-late --split-minutes 30
      modeshape run frames/img%04d.png --mask sheet.png --frames 10:200
      modeshape run sheet.mp4 --focal 900 --shapes-out shapes.npz --json
      modeshape run sheet.mp4 --texture logo.png --place 250 160 90 60 --view
    """

    ESSENTIAL: ClassVar = (
        *("source", "roi", "corners", "mask", "frames", "focal", "size_mm", "out", "shapes_out", "texture"),
        *("view", "ground_truth", "json", "verbose", "overwrite"),
    )

    ground_truth: Path | None = None
    """True shapes (.npz with W_px, S_gt, gt_frames) to score the first object against."""
    texture: Path | None = None
    """Picture (or video: its first) painted on the first object's mesh in recording and viewer; for a video of it:
    modeshape retexture."""
    output: tyro.conf.OmitArgPrefixes[Output] = Output()

    @property
    def live(self) -> bool:
        """Whether frames come from a camera or stream, which do not wait."""
        return self.source.isdigit() or "://" in self.source

    @property
    def passes(self) -> bool:
        """Whether frames are kept for a final pass: those of a file, whose recording stays one file."""
        return self.final_pass and not self.live and self.output.split_minutes is None

    @property
    def json(self) -> bool:
        """Whether the summary is printed as JSON."""
        return self.output.json

    @property
    def verbose(self) -> bool:
        """Whether all of it is printed."""
        return self.output.verbose


@dataclass(frozen=True)
class Demo(Json):
    """Render the sample video, reconstruct it, score it against its truth and record it to recordings/demo.rrd."""

    view: bool = False
    """Open the viewer and watch live."""


def placeable(place: tuple[float, ...]) -> bool:
    """Whether numbers are x, y, width and height, or four corners of a figure with an area."""
    return min(place[2:]) >= 1 if len(place) == 4 else len(place) == 8 and convex(place)


def convex(corners: tuple[float, ...]) -> bool:
    """Whether x, y, x, y, … go round a figure without crossing or caving in."""
    points = list(zip(corners[::2], corners[1::2], strict=True))
    ahead = zip(points, points[1:] + points[:1], points[2:] + points[:2], strict=True)
    turns = [(b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) for a, b, c in ahead]
    return all(turn > 0 for turn in turns) or all(turn < 0 for turn in turns)


def parse_range(text: str) -> tuple[int, int | None]:
    """`A:B` as (A, B), with 0 and None where left out.

    Raises:
        UsageError: not of that form.
    """
    first, colon, stop = text.partition(":")
    try:
        if not colon:
            raise ValueError
        a, b = int(first or 0), int(stop) if stop else None
        if a < 0 or (b is not None and b <= a):
            raise ValueError
    except ValueError:
        raise UsageError(f"--frames {text} is no range: give A:B with 0 <= A < B, for instance 0:300") from None
    return a, b


def configuration(config: Run) -> dict[str, object]:
    """The options by name, without groups, as they are stored in a recording."""
    chosen = asdict(config)
    model = chosen.pop("model")
    model["priors"] = priors_text(model["priors"])
    chosen_above = ("rest_shape", "estimate_focal")
    chosen |= {name: value for name, value in model.items() if name not in chosen_above} | chosen.pop("output")
    return {
        name: list(v) if isinstance(v, tuple) else v if isinstance(v, int | float | None) else str(v)
        for name, v in chosen.items()
    }
