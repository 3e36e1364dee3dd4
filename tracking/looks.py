"""What the points of a surface look like, to know them again."""

from copy import deepcopy

import cv2
import numpy as np

from tracking import Array, Flags, Floats
from tracking.appearance import Appearance
from tracking.flow import Grays

PATCH_RADIUS = 7
PROBES = 30  # points that tell how clear a picture is
CLEARER = 1.5  # times as clear as the reference, by their median, a frame is the reference from now on, if ...
MOSTLY = 0.8  # ... it shows so many of the points


class Looks:
    """Patches around the points in the reference frame, and in the last frame that surely showed each.

    Args:
        pictures: of the reference frame, as of `pictures_of`.
        points_px: (P, 2) the points in it.

    Attributes:
        levels: as they were in the reference frame, in each of its pictures.
        recent: as they were when last surely placed, in the fine picture.
    """

    def __init__(self, pictures: list[Floats], points_px: Array) -> None:
        self.levels = [Appearance(picture, points_px / 2.0**k, PATCH_RADIUS) for k, picture in enumerate(pictures)]
        self.recent = deepcopy(self.levels[0])
        self._probes = np.unique(np.linspace(0, len(points_px) - 1, PROBES).astype(np.int64))
        self._now = Appearance(pictures[0], points_px[self._probes], PATCH_RADIUS)

    def renew(self, pictures: list[Floats], points_px: Array, affine: Array, seen: Flags) -> bool:
        """Take a frame as the reference if it shows the points much clearer than that did; whether it is.

        What was blurred, or out of focus, is not known again when it is sharp. A place is as right as the points are in
        the clearer frame; since each must be so much clearer than the one before, errors hardly add up.

        Args:
            pictures: of the frame, as of `pictures_of`.
            points_px: (P, 2) in it.
            affine: (P, 2, 2) maps from the reference frame to it.
            seen: (P,) which of them it shows.
        """
        which = np.flatnonzero(seen[self._probes])
        probes = self._probes[which]
        if len(which) == 0 or seen.mean() < MOSTLY:
            return False
        self._now.learn(pictures[0], points_px[probes], affine[probes], which)
        if np.median(self._now.clarity(which) / self.levels[0].clarity(probes)) < CLEARER:
            return False
        which = np.flatnonzero(seen)
        for k, level in enumerate(self.levels):
            level.learn(pictures[k], points_px[which] / 2.0**k, affine[which], which)
        self.recent.learn(pictures[0], points_px[which], affine[which], which)
        return True


def pictures_of(grays: Grays) -> list[Floats]:
    """The picture, its half and its quarter, as float32."""
    return [picture.astype(np.float32) for picture in (grays.full, grays.half, cv2.pyrDown(grays.half))]
