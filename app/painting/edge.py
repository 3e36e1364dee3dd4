"""The edge of what is in front: its pixels show the surface as it was, too; they get the colour of what is beside them."""

from typing import Any, cast

import cv2
import numpy as np

from app.arrays import Floats, Image, Mask

FEATHER_PX = 0.6  # half-resolution px, of the mask
AROUND_PX = 2.0  # half-resolution px: how far around colours are taken from
SMALL = np.ones((3, 3), np.uint8)


def composed(image: Image, painted: Image, mask: Mask) -> Image:
    """A part of a frame with what is in front before the surface as it is painted, (2h, 2w, 3).

    Args:
        image: (2h, 2w, 3) the part as it was.
        painted: (2h, 2w, 3) with nothing in front.
        mask: (h, w) where something is in front.
    """
    size, (h, w) = image.shape[1::-1], mask.shape
    inner = cv2.erode(mask, SMALL).astype(np.float32)
    small = cv2.resize(image, (w, h), interpolation=cv2.INTER_AREA) * inner[..., None]
    sums = enlarged(cv2.GaussianBlur(cv2.merge([small, inner]), (0, 0), AROUND_PX), size)
    around = sums[..., :3] / np.maximum(sums[..., 3:], 1e-4)
    surely = enlarged(blurred(inner), size) + (sums[..., 3] < 1e-2)
    share = enlarged(blurred(mask.astype(np.float32)), size)
    # Blended with weights that sum to one: what is in front, its colour around, and the surface.
    seen = np.clip(surely, 0, share)
    return cast(
        Image,
        np.rint(seen[..., None] * image + (share - seen)[..., None] * around + (1 - share)[..., None] * painted).astype(
            np.uint8
        ),
    )


def blurred(mask: Floats) -> Floats:
    """A mask with a soft edge."""
    return cast(Floats, cv2.GaussianBlur(mask, (0, 0), FEATHER_PX))


def enlarged(picture: Any, size: tuple[int, int]) -> Floats:
    """A picture in a larger size (width, height)."""
    return cast(Floats, cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR))
