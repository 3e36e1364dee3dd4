"""What the points of a frame are seen to do."""

from dataclasses import dataclass

from tracking import Array, Flags


@dataclass(frozen=True)
class Observation:
    """What one frame shows of the points.

    Attributes:
        points_px: (P, 2) image points W^f, NaN where not visible.
        visible: (P,) h^f.
        alike: share of the points followed so far that looked as in the reference frame; others may have slid.
        renewed: whether this frame is so much clearer that it is the reference from now on.
    """

    points_px: Array
    visible: Flags
    alike: float = 1.0
    renewed: bool = False
