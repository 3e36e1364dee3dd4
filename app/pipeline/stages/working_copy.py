"""Large pictures are kept smaller and followed in a smaller copy still: points are as sure, in a fraction of the time."""

from dataclasses import replace
from typing import cast

import cv2
import numpy as np

from app.arrays import Array, Image
from app.pipeline.stages.messages import Footage
from tracking.guarded import Guarded
from tracking.region.search import Found
from tracking.region.surface import Surface
from tracking.video import Frame

LARGE_PX = 2560  # of the larger side, from which on there is a copy
SIDE_PX = 960  # of the copy's, at least
KEPT_PX = 1920  # of pictures that are recorded and shown, at most, unless more is asked for


class WorkingCopy:
    """Between a picture's pixels and those of its copy.

    Args:
        size: (width, height) px of the pictures.
        full: whether they are to be taken as they are.
        wide: px of the width that is asked for of those kept, if any is.

    Attributes:
        factor: pixels of a picture in one of its copy; 1 where there is none.
        size: (width, height) px of the copy.
        kept: (width, height) px of pictures as they are kept.
    """

    def __init__(self, size: tuple[int, int], *, full: bool = False, wide: int = 0, large_px: int = LARGE_PX) -> None:
        self._size = size
        self.factor = max(size) // SIDE_PX if max(size) >= large_px and not full else 1
        self.size = size[0] // self.factor, size[1] // self.factor
        step = 1 if self.factor == 1 or wide > KEPT_PX else -(-max(size) // KEPT_PX)
        self.kept = size[0] // step, size[1] // step

    @classmethod
    def of(cls, footage: Footage, size: tuple[int, int]) -> "WorkingCopy":
        """That of pictures of a size, as a run wants it."""
        return cls(size, full=footage.full_size, wide=footage.image_width or 0)

    def keep(self, frame: Frame) -> Frame:
        """A frame with its picture as it is kept."""
        return replace(frame, image=resized(frame.image, self.kept))

    def picture(self, image: Image) -> Image:
        """The copy of a picture (H, W, 3), however it is kept, or a region (H, W)."""
        return resized(image, self.size)

    def points(self, points_px: Array) -> Array:
        """Where points (n, 2) px of a picture are in its copy."""
        return np.asarray((points_px + 0.5) / self.factor - 0.5)

    def in_picture(self, points_px: Array) -> Array:
        """Where points (n, 2) px of the copy are in the picture."""
        return np.asarray((points_px + 0.5) * self.factor - 0.5)

    def region(self, region: Image) -> Image:
        """A region (H, W) of the copy, of the picture."""
        return resized(region, self._size)

    def guarded(self, seen: Guarded) -> Guarded:
        """What the copy shows, in the picture's pixels."""
        observation = seen.observation
        return replace(seen, observation=replace(observation, points_px=self.in_picture(observation.points_px)))

    def found(self, found: Found) -> Found:
        """What was found in the copy, in the picture's pixels."""
        if self.factor == 1:
            return found
        best = None if found.surface is None else self._surface(found.surface)
        others = [self._surface(other) for other in found.others]
        return replace(found, region=self.region(found.region), surface=best, others=others)

    def _surface(self, surface: Surface) -> Surface:
        return replace(surface, mask=self.region(surface.mask))


def resized(image: Image, size: tuple[int, int]) -> Image:
    """A picture (H, W, 3), or a region (H, W), of another (width, height); itself if it has that."""
    if image.shape[1::-1] == size:
        return image
    smaller = cv2.INTER_AREA if size[0] < image.shape[1] else cv2.INTER_LINEAR
    return cast(Image, cv2.resize(image, size, interpolation=smaller if image.ndim == 3 else cv2.INTER_NEAREST))
