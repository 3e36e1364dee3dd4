"""Where something is in front of the surface: what cannot be the surface under any light, and no tracked point is seen."""

from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from app.painting.shading import Floats, View

Mask = NDArray[np.uint8]

WINDOW = 9  # half-resolution px: a patch that is judged as one
STRANGE = 6.0  # mean squared difference of a patch, in variances, that no light explains
STILL_STRANGE = 3.0  # where something was in front in the frame before
POINTS_PX = 12.0  # half-resolution px: reach of a point that is seen or not
SEEN_HELP, LOST_HURT = 3.0, 0.4  # factors of STRANGE where points are seen, and where they are not
DARKER, BRIGHTER = 0.5, 1.6  # change of light from one frame to the next that is believed
PIXEL_STRANGE = 2.0  # standard deviations, of a pixel
BINS = (8, 32, 32)  # of brightness and two of colour, for telling a hand by its colours
CHROMA = (48, 207)
RARE = 2e-5  # share of a colour that is never seen
FOREIGN, STILL_FOREIGN = (
    1.7,
    1.0,
)  # mean logarithm of the ratio of colours: of something new, and of what was in front before
LEAST_PX = 30  # half-resolution px: smaller patches are no hand
LEAST_INNER = 0.08  # share of the surface, of patches that do not reach its outline: mouths and eyes are none


def in_front(
    view: View, last_shade: Floats, was: Mask, points: NDArray[np.float64], visible: NDArray[np.bool_]
) -> tuple[Mask, Floats]:
    """Where something hides the surface: (h, w) 0 or 1; and how well the frame agrees with its prediction, (h, w) 0 … 1.

    Args:
        view: the frame against its prediction.
        last_shade: (h, w) shading of the last frame.
        was: (h, w) the last frame's answer.
        points: (p, 2) half-resolution px.
        visible: (p,) which of them are seen.
    """
    factor = threshold_factor(view.inside.shape, points, visible)
    weight = view.inside / view.variance
    predicted, seen = view.predicted, view.seen
    pp, ip, ii = (
        weight * np.einsum("hwc,hwc->hw", a, b) for a, b in ((predicted, predicted), (seen, predicted), (seen, seen))
    )
    sums = cv2.boxFilter(cv2.merge([pp, ip, ii, view.inside]), -1, (WINDOW, WINDOW), normalize=False)
    light = np.clip(sums[..., 1] / np.maximum(sums[..., 0], 1e-3), DARKER * last_shade, BRIGHTER * last_shade)
    count = 3.0 * np.maximum(sums[..., 3], 1.0)
    strange = (sums[..., 2] - 2 * light * sums[..., 1] + light**2 * sums[..., 0]) / count
    limit = np.where(was > 0, STILL_STRANGE, STRANGE) * factor
    agreement = (1.0 / (1.0 + (strange / STRANGE) ** 2)).astype(np.float32)
    core = ((strange > limit) & (view.inside > 0)).astype(np.uint8)
    core = reaching(cast(Mask, cv2.morphologyEx(core, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))), view.inside)
    if core.any():
        ratio = colour_ratio(view, core, last_shade)
        core = foreign(core, ratio, was)
        if core.any():
            core = outlined(core, view, last_shade, ratio)
    return core, agreement


def colour_ratio(view: View, core: Mask, shade: Floats) -> Floats:
    """How much more usual a pixel's colour is in the patches than on the surface, now or as predicted: logarithm (h, w)."""
    seen, expected = codes(view.seen), codes(view.predicted * shade[..., None])
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (WINDOW, WINDOW))
    middle = cast(Mask, cv2.erode(core, np.ones((5, 5), np.uint8)))
    away = ((view.inside > 0) & (cv2.dilate(core, disc) == 0)).astype(np.uint8)
    strangers = histogram(seen, middle if middle.any() else core)
    own = 0.5 * histogram(seen, away) + 0.5 * histogram(expected, view.inside.astype(np.uint8))
    ratios = np.log((strangers + RARE) / (own + RARE)).astype(np.float32)
    return cast(Floats, ratios[tuple(np.moveaxis(seen, -1, 0))])


def codes(picture: Floats) -> NDArray[np.uint8]:
    """Bins (h, w, 3) of brightness and of two of colour."""
    colours = cv2.cvtColor(np.clip(picture, 0, 255).astype(np.uint8), cv2.COLOR_BGR2YCrCb)
    chroma = np.clip(colours[..., 1:], *CHROMA) - np.uint8(CHROMA[0])
    return np.dstack([colours[..., 0] // 32, chroma // 5]).astype(np.uint8)


def histogram(picture: NDArray[np.uint8], where: Mask) -> Floats:
    """Share (8, 32, 32) of each bin in the pixels where a mask is set, smoothed in colour."""
    counts = cv2.calcHist([picture], [0, 1, 2], where, list(BINS), [0, 8, 0, 32, 0, 32])
    smooth = np.stack([cv2.GaussianBlur(plane, (0, 0), 1.0) for plane in counts])
    return cast(Floats, smooth / max(float(counts.sum()), 1.0))


def foreign(core: Mask, ratio: Floats, was: Mask) -> Mask:
    """Those patches whose colours are not the surface's own: a mouth that opens is no hand."""
    count, label = cv2.connectedComponents(core, connectivity=8)
    area = np.maximum(np.bincount(label.ravel(), minlength=count), 1)
    own = np.bincount(label.ravel(), np.clip(ratio, -3, 3).ravel(), minlength=count) / area
    known = np.bincount(label.ravel(), was.ravel(), minlength=count) / area
    kept = own > np.where(known > 0.3, STILL_FOREIGN, FOREIGN)
    kept[0] = False
    return cast(Mask, kept[label].astype(np.uint8))


def outlined(core: Mask, view: View, shade: Floats, ratio: Floats) -> Mask:
    """The patches with the outline of what is in front, by the pixels' colours and what is predicted there."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (WINDOW, WINDOW))
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    maybe = cv2.dilate(core, disc)
    off = view.seen - shade[..., None] * view.predicted
    strange = np.sqrt(cv2.GaussianBlur(np.einsum("hwc,hwc->hw", off, off) / (3.0 * view.variance), (0, 0), 1.0))
    score = cv2.GaussianBlur(np.clip(ratio, -3, 3), (0, 0), 1.0) + np.clip(2 * (strange - PIXEL_STRANGE), -4, 0.5)
    found = ((maybe > 0) & (score > 0)).astype(np.uint8)
    found = cast(Mask, cv2.morphologyEx(cv2.morphologyEx(found, cv2.MORPH_OPEN, small), cv2.MORPH_CLOSE, small))
    return reaching(found, view.inside)


def reaching(mask: Mask, inside: Floats) -> Mask:
    """Those patches of a mask that reach over the surface's outline, as an arm does, or are very large."""
    count, label, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    inner = cv2.erode(
        (inside > 0).astype(np.uint8), np.ones((7, 7), np.uint8), borderType=cv2.BORDER_CONSTANT, borderValue=0
    )
    at_edge = np.bincount(label[inner == 0], minlength=count) > 0
    area = stats[:, cv2.CC_STAT_AREA]
    kept = (area >= LEAST_PX) & (at_edge | (area > LEAST_INNER * inside.sum()))
    kept[0] = False
    return cast(Mask, kept[label].astype(np.uint8))


def threshold_factor(shape: tuple[int, ...], points: NDArray[np.float64], visible: NDArray[np.bool_]) -> Floats:
    """How much more than usual a patch (h, w) must differ: more where points are seen, less where they are lost."""
    h, w = shape
    step = 4
    size = (h // step + 1, w // step + 1)
    cell = np.rint(points / step).astype(np.int64)
    within = ((cell >= 0) & (cell < size[::-1])).all(axis=1)
    number = cell[within, 1] * size[1] + cell[within, 0]
    maps = [np.bincount(number, flags[within].astype(float), minlength=size[0] * size[1]) for flags in (visible, ~visible)]
    near = cv2.GaussianBlur(np.stack(maps, axis=-1).reshape(*size, 2), (0, 0), POINTS_PX / 2 / step)
    share = (near[..., 0] + 1e-3) / (near.sum(axis=-1) + 2e-3)
    factor = LOST_HURT * (SEEN_HELP / LOST_HURT) ** share
    return cast(Floats, cv2.resize(factor.astype(np.float32), (w, h), interpolation=cv2.INTER_LINEAR))
