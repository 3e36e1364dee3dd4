"""The region of interest: a rectangle, a polygon or a mask picture."""

from collections.abc import Sequence
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from tracking import Array, Image, TrackingError


def region_mask(
    size: tuple[int, int],
    roi: tuple[int, int, int, int] | None = None,
    mask: Path | None = None,
    polygon: Sequence[float] | None = None,
) -> Image:
    """Where points are looked for: (H, W) uint8, 255 inside.

    Args:
        size: (width, height) of the video.
        roi: x, y, width, height of a rectangle in px; with `mask` too, what lies in both.
        mask: a picture of the video's size, inside where it is brighter than middle grey.
        polygon: x, y, x, y, … of its corners in px, which may lie a little outside the picture; what lies in all of them.

    Raises:
        TrackingError: the rectangle leaves the picture; the mask is unreadable, of another size, or empty.
    """
    width, height = size
    region = np.full((height, width), 255, np.uint8)
    if mask is not None:
        region = _read_mask(mask, size)
    if roi is not None:
        x, y, w, h = roi
        if w <= 0 or h <= 0 or x < 0 or y < 0 or x + w > width or y + h > height:
            raise TrackingError(f"the region {x} {y} {w} {h} (x y width height) leaves the picture of {width}x{height} px")
        inside = np.zeros_like(region)
        inside[y : y + h, x : x + w] = 255
        region &= inside
    if polygon is not None:
        corners = np.rint(np.reshape(polygon, (-1, 2))).astype(np.int32)
        inside = np.zeros_like(region)
        cv2.fillPoly(inside, [corners], 255)
        if not inside.any() or cv2.contourArea(corners) < 1:
            told = " ".join(f"{value:g}" for value in polygon)
            raise TrackingError(f"the corners {told} have no area in the picture of {width}x{height} px")
        region &= inside
    if not region.any() and mask is None:
        raise TrackingError("the rectangle and the corners do not meet: no pixel lies in both")
    if not region.any():
        where = f"{mask}" if roi is None else f"{mask} within the region {roi[0]} {roi[1]} {roi[2]} {roi[3]}"
        raise TrackingError(f"the mask is empty: {where} is black; paint the surface to follow white")
    return region


def outline(region: Image) -> list[Array]:
    """The borders of a region (H, W) uint8, closed, (n, 2) px each; none if it is the whole picture."""
    if region.all():
        return []
    found = cv2.findContours(region, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]
    smooth = [cv2.approxPolyDP(contour, 1.0, closed=True)[:, 0] for contour in found]
    return [np.concatenate([line, line[:1]]).astype(np.float64) for line in smooth]


def _read_mask(path: Path, size: tuple[int, int]) -> Image:
    if not path.is_file():
        raise TrackingError(f"no mask file {path}; check the path")
    encoded = np.fromfile(path, np.uint8)
    picture = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE) if encoded.size else None
    if picture is None:
        raise TrackingError(f"the mask {path} is not a picture that can be read; save it as PNG")
    found = (picture.shape[1], picture.shape[0])
    if found != size:
        raise TrackingError(
            f"the mask {path} has {found[0]}x{found[1]} px, the video {size[0]}x{size[1]}; they must be equal"
        )
    return np.where(cast(Image, picture) > 127, 255, 0).astype(np.uint8)
