"""Points that are left behind when the surface moves: on the wall, a watermark, a time code, the picture's border."""

import numpy as np

from tracking import Array, Flags
from tracking.consistency import spacing_px
from tracking.observation import Observation

STAYS_PX = 2.0  # from where it began a point that stays is not farther
# The usual way of the moving points beside it: between them and it the motion is torn, no surface bends so. In distances
# between points, too: beside the crease of a card those of the page that turns go nearly so far.
TORN_PX, TORN_SPACINGS = 10.0, 1.5
BESIDE = 8  # of them
MOVING = 0.5  # of the points seen must move, or the surface is what stays
FRAMES = 15  # in which that is so, without one in between in which it moves, and a point is given up for good


class LeftBehind:
    """Watches for points that stay where they began while those beside them go.

    Args:
        points_px: (P, 2) where the points began.

    Attributes:
        points: (P,) those found so far.
    """

    def __init__(self, points_px: Array) -> None:
        self._reference = points_px
        self._torn_px = max(TORN_PX, TORN_SPACINGS * spacing_px(points_px))
        self._frames = np.zeros(len(points_px), np.int64)
        self.points: Flags = np.zeros(len(points_px), np.bool_)

    def look(self, observation: Observation) -> int:
        """See where the points are in the next frame; the number of those found with it."""
        seen = observation.visible & ~self.points
        way = np.where(seen, np.linalg.norm(observation.points_px - self._reference, axis=1), np.nan)
        stays, moves = way <= STAYS_PX, way > STAYS_PX
        self._frames[moves] = 0
        if not stays.any() or moves.sum() < max(BESIDE, MOVING * seen.sum()):
            return 0
        behind, going = np.flatnonzero(stays), np.flatnonzero(moves)
        distance = ((self._reference[behind, None] - self._reference[going]) ** 2).sum(axis=2)
        beside = going[np.argpartition(distance, BESIDE - 1, axis=1)[:, :BESIDE]]
        self._frames[behind[np.median(way[beside], axis=1) > self._torn_px]] += 1
        found = ~self.points & (self._frames >= FRAMES)
        self.points |= found
        return int(found.sum())
