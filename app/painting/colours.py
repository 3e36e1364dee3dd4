"""Which pixels show the occluder: its colours, learned from where it surely is, against the surface as it should look."""

from typing import cast

import cv2
import numpy as np

from app.arrays import Floats, Image, Mask
from app.painting.shading import View

BINS = (8, 32, 32)  # of brightness and two of colour
CHROMA = (48, 207)
BIN_VOLUME = 3400.0  # of colours: cubed grey levels
UNIFORM = 256.0**-3  # density of any colour
ODD = 0.01  # share of the occluder's colours that are any, and of the surface's
LEARNS = 0.3  # of the occluder's colours, from frame to frame
RARE = 2e-5  # share of a colour that is never seen
SURELY = 9.0  # variances off its prediction, of a pixel that the colours are learned from
SHADOW, GLOSS = 0.7, 1.2  # of the light, within which the surface may be lit otherwise than around
LIGHT_SPREAD = 0.15


class Colours:
    """The occluder's colours: a histogram that is carried on while there is an occluder."""

    def __init__(self) -> None:
        self._histogram: Floats | None = None

    def forget(self) -> None:
        """There is no occluder any more."""
        self._histogram = None

    def ratio(self, view: View, shade: Floats, patches: Mask, zone: Mask) -> Floats:
        """Logarithm (h, w) of how much likelier pixels show the occluder than the surface; 0 outside of a zone (h, w).

        Args:
            view: the frame against its prediction.
            shade: (h, w) its shading.
            patches: (h, w) where the occluder is, but for its outline and what is between its fingers.
            zone: (h, w) where it is looked for.
        """
        part = bounding(zone)
        seen = view.seen[part]
        deviation, surface = surface_likelihood(seen, view.predicted[part], view.variance[part], shade[part])
        code = codes(seen)
        middle = cv2.erode(patches[part], np.ones((5, 5), np.uint8)) * (deviation > SURELY).astype(np.uint8)
        if not middle.any():
            middle = patches[part]
        counted = histogram(code, cast(Mask, middle))
        old = counted if self._histogram is None else self._histogram
        self._histogram = cast(Floats, old + LEARNS * (counted - old))
        table = np.log((1 - ODD) / BIN_VOLUME * self._histogram + ODD * UNIFORM).astype(np.float32)
        ratio = np.zeros(zone.shape, np.float32)
        ratio[part] = table[tuple(np.moveaxis(code, -1, 0))] - surface
        return ratio


def foreign(view: View, shade: Floats, patches: Mask) -> Floats:
    """Logarithm (h, w) of how much more frequent a pixel's colour is in patches than elsewhere on the surface, −3 to 3.

    Args:
        view: the frame against its prediction.
        shade: (h, w) its shading.
        patches: (h, w) 0 or 1.
    """
    seen, expected = codes(view.seen), codes(view.predicted * shade[..., None])
    middle = cast(Mask, cv2.erode(patches, np.ones((5, 5), np.uint8)))
    away = ((view.inside > 0) & (cv2.dilate(patches, np.ones((9, 9), np.uint8)) == 0)).astype(np.uint8)
    here = histogram(seen, middle if middle.any() else patches)
    surface = 0.5 * histogram(seen, away) + 0.5 * histogram(expected, view.inside.astype(np.uint8))
    ratio = np.log((here + RARE) / (surface + RARE)).astype(np.float32)
    return cast(Floats, np.clip(ratio[tuple(np.moveaxis(seen, -1, 0))], -3, 3))


def surface_likelihood(seen: Floats, predicted: Floats, variance: Floats, shade: Floats) -> tuple[Floats, Floats]:
    """Squared deviation from the prediction in variances, and log-density of the colour if it is the surface's, (h, w)."""
    lit = predicted * shade[..., None]
    power = np.einsum("hwc,hwc->hw", lit, lit) + 1.0
    light = np.clip(np.einsum("hwc,hwc->hw", seen, lit) / power, SHADOW, GLOSS)
    off = seen - light[..., None] * lit
    deviation = np.einsum("hwc,hwc->hw", off, off) / variance + ((light - 1) / LIGHT_SPREAD) ** 2
    density = (1 - ODD) * np.exp(-0.5 * deviation) * (2 * np.pi * variance) ** -1.5 + ODD * UNIFORM
    return deviation.astype(np.float32), np.log(density).astype(np.float32)


def bounding(mask: Mask) -> tuple[slice, slice]:
    """Rows and columns around what is set in a mask that is not empty."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


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
