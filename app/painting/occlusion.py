"""The occlusion mask: where something, a hand for instance, is in front of the surface.

A patch is occluded if no change of light explains its difference to the prediction. Tracked points that are seen there
raise the threshold, points that are not seen lower it. Pixels are those of half the resolution.
"""

from typing import cast

import cv2
import numpy as np

from app.arrays import Array, Flags, Floats, Image, Mask
from app.painting.shading import View

PATCH_PX = 9  # side of the patches
MISMATCH = 6.0  # mean squared difference of a patch, in variances, that light does not explain
MISMATCH_BEFORE = 3.0  # the same where the mask of the frame before is set
POINTS_PX = 12.0  # reach of a tracked point
VISIBLE_FACTOR, MISSING_FACTOR = 3.0, 0.4  # of MISMATCH, where points are seen and where they are not
DARKER, BRIGHTER = 0.5, 1.6  # largest change of light from one frame to the next
PIXEL_DEVIATIONS = 2.0  # of a pixel from its prediction
BINS = (8, 32, 32)  # of brightness and two of colour
CHROMA = (48, 207)
RARE = 2e-5  # share of a colour that is never seen
LOG_RATIO, LOG_RATIO_BEFORE = 1.7, 1.0  # mean logarithm of the ratio of colours: of a new patch, and where the mask was set
LEAST_PX = 30  # area of the smallest patch
LEAST_INNER = 0.08  # share of the surface, of patches inside its outline: mouths and eyes are smaller


def occlusion_mask(view: View, shade: Floats, before: Mask, points: Array, visible: Flags) -> tuple[Mask, Floats]:
    """Where something hides the surface: (h, w) 0 or 1; and how well the frame agrees with its prediction, (h, w) 0 … 1.

    Args:
        view: the frame against its prediction.
        shade: (h, w) shading of the frame before.
        before: (h, w) mask of the frame before.
        points: (p, 2) half-resolution px.
        visible: (p,) which of them are seen.
    """
    factor = threshold_factor(view.inside.shape, points, visible)
    weight = view.inside / view.variance
    predicted, seen = view.predicted, view.seen
    pp, ip, ii = (
        weight * np.einsum("hwc,hwc->hw", a, b) for a, b in ((predicted, predicted), (seen, predicted), (seen, seen))
    )
    sums = cv2.boxFilter(cv2.merge([pp, ip, ii, view.inside]), -1, (PATCH_PX, PATCH_PX), normalize=False)
    light = np.clip(sums[..., 1] / np.maximum(sums[..., 0], 1e-3), DARKER * shade, BRIGHTER * shade)
    count = 3.0 * np.maximum(sums[..., 3], 1.0)
    mismatch = (sums[..., 2] - 2 * light * sums[..., 1] + light**2 * sums[..., 0]) / count
    limit = np.where(before > 0, MISMATCH_BEFORE, MISMATCH) * factor
    agreement = (1.0 / (1.0 + (mismatch / MISMATCH) ** 2)).astype(np.float32)
    patches = ((mismatch > limit) & (view.inside > 0)).astype(np.uint8)
    patches = cast(Mask, cv2.morphologyEx(patches, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)))
    patches = across_outline(patches, view.inside)
    if patches.any():
        ratio = colour_ratio(view, patches, shade)
        patches = of_other_colours(patches, ratio, before)
        if patches.any():
            patches = refined(patches, view, shade, ratio)
    return patches, agreement


def colour_ratio(view: View, patches: Mask, shade: Floats) -> Floats:
    """Logarithm (h, w) of how much more frequent a pixel's colour is in the patches than on the surface."""
    seen, expected = codes(view.seen), codes(view.predicted * shade[..., None])
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (PATCH_PX, PATCH_PX))
    middle = cast(Mask, cv2.erode(patches, np.ones((5, 5), np.uint8)))
    away = ((view.inside > 0) & (cv2.dilate(patches, disc) == 0)).astype(np.uint8)
    occluder = histogram(seen, middle if middle.any() else patches)
    surface = 0.5 * histogram(seen, away) + 0.5 * histogram(expected, view.inside.astype(np.uint8))
    ratios = np.log((occluder + RARE) / (surface + RARE)).astype(np.float32)
    return ratios[tuple(np.moveaxis(seen, -1, 0))]


def codes(picture: Floats) -> Image:
    """Bins (h, w, 3) of brightness and of two of colour."""
    colours = cv2.cvtColor(np.clip(picture, 0, 255).astype(np.uint8), cv2.COLOR_BGR2YCrCb)
    chroma = np.clip(colours[..., 1:], *CHROMA) - np.uint8(CHROMA[0])
    return np.dstack([colours[..., 0] // 32, chroma // 5]).astype(np.uint8)


def histogram(picture: Image, where: Mask) -> Floats:
    """Share (8, 32, 32) of each bin in the pixels where a mask is set, smoothed in colour."""
    counts = cv2.calcHist([picture], [0, 1, 2], where, list(BINS), [0, 8, 0, 32, 0, 32])
    smooth = np.stack([cv2.GaussianBlur(plane, (0, 0), 1.0) for plane in counts])
    return cast(Floats, smooth / max(float(counts.sum()), 1.0))


def of_other_colours(patches: Mask, ratio: Floats, before: Mask) -> Mask:
    """The patches whose colours are not the surface's: an opening mouth is the surface's own change."""
    count, label = cv2.connectedComponents(patches, connectivity=8)
    area = np.maximum(np.bincount(label.ravel(), minlength=count), 1)
    mean_ratio = np.bincount(label.ravel(), np.clip(ratio, -3, 3).ravel(), minlength=count) / area
    known = np.bincount(label.ravel(), before.ravel(), minlength=count) / area
    kept = mean_ratio > np.where(known > 0.3, LOG_RATIO_BEFORE, LOG_RATIO)
    kept[0] = False
    return kept[label].astype(np.uint8)


def refined(patches: Mask, view: View, shade: Floats, ratio: Floats) -> Mask:
    """The mask at the pixels' resolution: near the patches, by colour and by the difference to the prediction."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (PATCH_PX, PATCH_PX))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    near = cv2.dilate(patches, disc)
    off = view.seen - shade[..., None] * view.predicted
    deviations = np.sqrt(cv2.GaussianBlur(np.einsum("hwc,hwc->hw", off, off) / (3.0 * view.variance), (0, 0), 1.0))
    score = cv2.GaussianBlur(np.clip(ratio, -3, 3), (0, 0), 1.0) + np.clip(2 * (deviations - PIXEL_DEVIATIONS), -4, 0.5)
    mask = ((near > 0) & (score > 0)).astype(np.uint8)
    mask = cast(Mask, cv2.morphologyEx(cv2.morphologyEx(mask, cv2.MORPH_OPEN, small), cv2.MORPH_CLOSE, small))
    return across_outline(mask, view.inside)


def across_outline(mask: Mask, inside: Floats) -> Mask:
    """The components of a mask that cross the surface's outline, as an arm does, or are very large."""
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    inner = cv2.erode(
        (inside > 0).astype(np.uint8), np.ones((7, 7), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    at_edge = np.bincount(label[inner == 0], minlength=count) > 0
    area = stats[:, cv2.CC_STAT_AREA]
    kept = (area >= LEAST_PX) & (at_edge | (area > LEAST_INNER * inside.sum()))
    kept[0] = False
    return kept[label].astype(np.uint8)


def threshold_factor(shape: tuple[int, ...], points: Array, visible: Flags) -> Floats:
    """Factor (h, w) of the threshold: larger where points are seen, smaller where they are missing."""
    h, w = shape
    step = 4
    size = (h // step + 1, w // step + 1)
    cell = np.rint(points / step).astype(np.int64)
    within = ((cell >= 0) & (cell < size[::-1])).all(axis=1)
    number = cell[within, 1] * size[1] + cell[within, 0]
    maps = [np.bincount(number, flags[within].astype(float), minlength=size[0] * size[1]) for flags in (visible, ~visible)]
    near = cv2.GaussianBlur(np.stack(maps, axis=-1).reshape(*size, 2), (0, 0), POINTS_PX / 2 / step)
    share = (near[..., 0] + 1e-3) / (near.sum(axis=-1) + 2e-3)
    factor = MISSING_FACTOR * (VISIBLE_FACTOR / MISSING_FACTOR) ** share
    return cast(Floats, cv2.resize(factor.astype(np.float32), (w, h), interpolation=cv2.INTER_LINEAR))
