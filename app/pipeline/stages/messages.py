"""What the tracking stage is asked, and what it answers; light, so that it is asked before the rest of a run is loaded."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Self, get_args

from reconstruction.settings import RecoveredRestShape

if TYPE_CHECKING:
    from pathlib import Path

    from app.arrays import Array
    from app.options.run import Run
    from tracking import TrackingError
    from tracking.guarded import Guarded

LAG = 2  # frames between a frame and the first one whose tracking may know its shape: so many are on the way
RECOVERED = get_args(RecoveredRestShape)  # rest shapes that come from the first frames


@dataclass(frozen=True)
class Footage:
    """What is looked at, and what for: of a run's options those that matter to tracking.

    Attributes:
        source, frame_range, duration, drop_late: as `Video` takes them.
        roi, mask, outline: as `region_mask` takes them.
        search: whether the surface is looked for in that region.
        full_size: whether pictures are taken as they are.
        image_width: px, how wide recorded pictures are to be, if that is said.
        points: most.
        rest_shape: where it comes from.
    """

    source: str
    frame_range: tuple[int, int | None] = (0, None)
    duration: float | None = None
    drop_late: bool = False
    roi: tuple[int, int, int, int] | None = None
    mask: "Path | None" = None
    outline: tuple[float, ...] | None = None
    search: bool = True
    full_size: bool = False
    image_width: int | None = None
    points: int = 800
    rest_shape: str = "auto"

    @classmethod
    def of(cls, run: "Run") -> Self:
        """That of a run."""
        shared = {one.name: getattr(run, one.name) for one in fields(cls) if one.name != "image_width"}
        return cls(**shared, image_width=run.output.image_width)


@dataclass(frozen=True)
class Opened:
    """What is known of the source before its first frame.

    Attributes:
        size: (width, height) px.
        kept: (width, height) px of its pictures as they are kept.
        fps: announced rate.
        frame_count: announced number of frames, if any.
    """

    size: tuple[int, int]
    kept: tuple[int, int]
    fps: float
    frame_count: int | None


@dataclass(frozen=True)
class Asked:
    """What to follow in the next frame.

    Attributes:
        expected_px: for each object, by its number, where its points are expected (P, 2); None where nobody knows. One that
            was not asked for before is looked for, and begins in that frame or a later one.
        kept: objects that were followed before: what they look like is kept, ...
        sought: ... and one of them is looked for.
    """

    expected_px: "Mapping[int, Array | None]"
    kept: tuple[int, ...] = ()
    sought: int | None = None


@dataclass(frozen=True)
class Begun:
    """An object begins.

    Attributes:
        points_px: (P, 2) its points.
        outline: the borders of the region they are from, (n, 2) px each.
    """

    points_px: "Array"
    outline: "list[Array]" = field(default_factory=list)


@dataclass(frozen=True)
class Seen:
    """What a frame shows.

    Attributes:
        number: of the frame, counted from 0.
        index: its number in the source.
        time_s: its time there.
        read_s: when it was read, of a live source when it came, as `time.monotonic` tells it.
        objects: the points of each object asked for, unless it is still looked for; an error where none can begin; of one
            that is kept if it is sought or was found.
        told: what the source has to tell, in words.
        stage_ms: milliseconds it took.
    """

    number: int
    index: int
    time_s: float
    read_s: float
    objects: "Mapping[int, Begun | Guarded | TrackingError]"
    told: tuple[str, ...]
    stage_ms: Mapping[str, float]

    def points(self, number: int) -> "Begun | Guarded":
        """Those of an object. Raises the error if it cannot begin."""
        found = self.objects[number]
        if isinstance(found, Exception):
            raise found
        return found

    def begun(self, number: int) -> Begun:
        """Those of an object that begins. Raises the error if it cannot."""
        found = self.points(number)
        assert isinstance(found, Begun)
        return found


def first_asked() -> list[Asked]:
    """What a run begins with: an object in the first frame, and that in those that are on the way."""
    return [Asked({0: None})] * LAG
