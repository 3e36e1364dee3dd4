"""Well-spread corners, the points to track."""

from typing import cast

import cv2
import numpy as np

from tracking import Array, Flags, Image, TrackingError

MIN_CORNERS = 12  # fewer carry no shape
MIN_SPACING_PX = 5.0  # closer corners share most of their patch
BORDER_PX = 10  # half a tracking window and its gradients
BLOCK_PX = 5  # over which the structure tensor is summed
LOCAL_QUALITY, SPACINGS = 0.05, 4.0  # of the best corner within so many spacings
FAINT_QUALITY, FAINT_SPACINGS = 0.02, 2.0  # the same, where whatever moves is to show: a face before full bookshelves, too
# The largest response (smaller eigenvalue of the structure tensor) in a 640x480 picture of pure noise is
# 3.4e-5 per unit of its variance; measured for deviations of 1, 3 and 10 grey levels.
NOISE_RESPONSE = 7e-5
# Grey levels the noise is held to: at least what one step of rounding in a blank part looks like; fine texture is no noise.
NOISE_RANGE = (0.75, 12.0)


def detect_corners(gray: Image, region: Image, max_points: int = 800, *, faint: bool = False) -> Array:
    """Corners (n, 2) px in the region, spread so that weakly textured parts get some too.

    A corner is the best of its neighbourhood, stands out of the picture's noise, and is at least some
    percent of the best corner a few spacings around; the spacing follows from the region's area.

    Args:
        gray: (H, W) uint8 picture.
        region: (H, W) uint8, points where it is not 0.
        max_points: at most so many are returned, and about as many where the texture allows.
        faint: fainter ones, too, which are not followed so well.

    Raises:
        TrackingError: there are fewer than `MIN_CORNERS`.
    """
    allowed = region > 0
    inner = np.zeros_like(allowed)
    inner[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX] = True
    allowed &= inner
    area = int(np.count_nonzero(allowed))
    corners = np.empty((0, 2))
    if area:
        quality = _quality(gray, allowed, np.sqrt(area / max_points), faint=faint)
        # Squares of the spacing can be packed into the area; corners fill 40-80 % of them.
        for packing in (1.3, 1.0, 0.8, 0.65):
            spacing = max(packing * np.sqrt(area / max_points), MIN_SPACING_PX)
            corners = _spread(quality, spacing)
            if len(corners) >= max_points or spacing == MIN_SPACING_PX:
                break
    if len(corners) < MIN_CORNERS:
        raise TrackingError(
            f"only {len(corners)} corners found in the region, at least {MIN_CORNERS} are needed; "
            "choose a region with texture, or start at a frame that shows it",
            "frames",
        )
    return corners[:max_points]


def _quality(gray: Image, allowed: Flags, spacing: float, *, faint: bool) -> Array:
    """The corner response (H, W) relative to the best a few spacings around; 0 where no corner may be."""
    response = cv2.cornerMinEigenVal(gray, BLOCK_PX, ksize=3)
    response[~allowed | (response < NOISE_RESPONSE * _noise(gray, allowed) ** 2)] = 0.0
    least, around = (FAINT_QUALITY, FAINT_SPACINGS) if faint else (LOCAL_QUALITY, SPACINGS)
    best = cv2.dilate(response, _square(around * spacing))
    return np.where(response >= least * best, response / np.maximum(best, 1e-12), 0.0)


def _noise(gray: Image, allowed: Flags) -> float:
    """Standard deviation of the noise in grey levels (Immerkaer 1996), where there is least texture."""
    mask = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)  # zero on linear gradients
    energy = cv2.blur(cv2.filter2D(gray, cv2.CV_32F, mask) ** 2, (15, 15))
    return float(np.clip(np.sqrt(np.percentile(energy[allowed], 10)) / 6.0, *NOISE_RANGE))


def _spread(quality: Array, spacing: float) -> Array:
    """Corners (n, 2), best first: greedy maxima at least `spacing` px apart along x or y."""
    free = quality.astype(np.float32)
    # Equal neighbours (flat tops) would all be maxima: the fraction of a millionth decides for one.
    tie = np.random.default_rng(0).random(free.shape, np.float32)
    free[free > 0] *= 1.0 + 1e-4 * tie[free > 0]
    square = _square(spacing)
    found = []
    while True:
        peaks = (free > 0) & (free == cv2.dilate(free, square))
        if not peaks.any():
            break
        found.append(np.argwhere(peaks)[:, ::-1])
        taken = cv2.dilate(peaks.astype(np.uint8), square)
        free[taken > 0] = 0.0
    if not found:
        return np.empty((0, 2))
    corners = np.concatenate(found)
    order = np.argsort(-quality[corners[:, 1], corners[:, 0]], kind="stable")
    return corners[order].astype(np.float64)


def _square(spacing: float) -> Image:
    """The pixels nearer than `spacing` along both axes."""
    side = 2 * int(np.ceil(spacing) - 1) + 1
    return cast(Image, np.ones((side, side), np.uint8))
