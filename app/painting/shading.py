"""Shading: how the light on a surface has changed since the first frame.

All at half the picture's resolution. The first frame, seen where the surface is now, predicts the picture under
the first frame's light. Their ratio is the change of shading. Displayed values are powers of light: a ratio of
them, applied to displayed values, is the same change of light.
"""

from dataclasses import dataclass
from typing import Any, TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from app.arrays import Array, Floats, Image

Pixels = TypeVar("Pixels", NDArray[np.uint8], Floats)

NOISE = 5.0  # grey levels, of the camera and its compression
MISPLACED = 0.3  # half-resolution px: how far the map may be off
FINE_PX = 2.0  # half-resolution px: folds of this width keep their shading
COARSE = 4  # factor of the coarser grid that is used where the fine one has too little texture
COARSE_PX = 3.0
TRUST = 0.1  # of the coarse estimate against the fine one
INERTIA = 0.02  # of the last frame's shading against the coarse one
DARKEST, BRIGHTEST = 0.15, 4.0


@dataclass(frozen=True)
class View:
    """A frame against its prediction, at half resolution.

    Attributes:
        seen: (h, w, 3) the frame.
        predicted: (h, w, 3) the first frame as the surface is now.
        variance: (h, w) of a channel's difference, by noise and misplacement.
        inside: (h, w) 1 where all of the pixel shows the surface, else 0.
    """

    seen: Floats
    predicted: Floats
    variance: Floats
    inside: Floats


class Reference:
    """The first frame, ready to predict others.

    Args:
        image: (H, W, 3) BGR.
    """

    def __init__(self, image: Image) -> None:
        small = halved(image)
        smooth = cv2.GaussianBlur(small, (0, 0), 0.7)
        slopes = [cv2.Scharr(smooth, cv2.CV_32F, dx, 1 - dx, scale=1 / 32) for dx in (0, 1)]
        steep = sum(((s**2).mean(axis=2) for s in slopes), np.zeros(small.shape[:2], np.float32))
        variance = NOISE**2 + MISPLACED**2 * cv2.GaussianBlur(steep, (0, 0), 1.0)
        self._layers = np.dstack([small, variance]).astype(np.float32)

    def view(self, seen: Floats, uv: Floats, cover: Floats) -> View:
        """The part of a frame, at half the resolution, that a map (h, w, 2) with its cover (h, w) belongs to."""
        inside = (halved(cover) == 1).astype(np.float32)
        places = (halved(uv) - np.float32(0.5)) * np.float32(0.5)
        layers = sampled(self._layers, places, cv2.BORDER_REPLICATE)
        return View(seen, layers[..., :3], layers[..., 3], inside)


def sampled(picture: Pixels, places: Floats, border: int) -> Pixels:
    """A picture (H, W, c) at places (h, w, 2) px between its pixels."""
    one_map_for_both: Any = None
    return cast(Pixels, cv2.remap(picture, places, one_map_for_both, cv2.INTER_LINEAR, borderMode=border))


def halved(picture: NDArray[np.uint8] | Floats) -> Floats:
    """Means of 2 by 2 pixels, float32."""
    h, w = picture.shape[:2]
    return cast(Floats, cv2.resize(picture, (w // 2, h // 2), interpolation=cv2.INTER_AREA).astype(np.float32))


def exposure(view: View, weight: Floats) -> Floats:
    """Gain of each channel (3,) against the prediction, relative to their mean: the light's change of colour."""
    both = np.einsum("hw,hwc,hwc->c", weight, view.seen, view.predicted)
    one = np.einsum("hw,hwc,hwc->c", weight, view.predicted, view.predicted)
    gains = (both + 1.0) / (one + 1.0)
    return cast(Floats, (gains / gains.mean()).astype(np.float32))


def shading(view: View, weight: Floats, last: Floats) -> Floats:
    """The ratio of seen to predicted brightness (h, w), smooth but for folds, where `weight` says that it can be seen.

    A least squares fit around every pixel, at two scales; where nothing is seen, `last` (h, w) is kept.
    """
    weight = weight / view.variance
    both = weight * np.einsum("hwc,hwc->hw", view.seen, view.predicted)
    one = weight * np.einsum("hwc,hwc->hw", view.predicted, view.predicted)
    h, w = last.shape
    small = (max(1, w // COARSE), max(1, h // COARSE))
    level = float(one.mean()) + 1e-6
    sums = cv2.resize(
        cv2.merge([both + INERTIA * level * last, one + INERTIA * level]), small, interpolation=cv2.INTER_AREA
    )
    sums = cv2.GaussianBlur(sums, (0, 0), COARSE_PX)
    coarse = cv2.resize(sums[..., 0] / sums[..., 1], (w, h), interpolation=cv2.INTER_LINEAR)
    fine = cv2.GaussianBlur(cv2.merge([both, one]), (0, 0), FINE_PX)
    ratio = (fine[..., 0] + TRUST * level * coarse) / (fine[..., 1] + TRUST * level)
    return cast(Floats, np.clip(ratio, DARKEST, BRIGHTEST))


def white_level(image: Image, inside: NDArray[np.uint8]) -> Array:
    """How bright white would be on the surface in the first frame: coefficients (6,) of a quadratic over the picture.

    Fitted from above to the brightness where `inside`: what is printed is darker than the paper.
    """
    small = cv2.resize(image, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA).max(axis=2).astype(np.float64)
    y, x = np.nonzero(cv2.resize(inside, small.shape[::-1], interpolation=cv2.INTER_AREA))
    if not len(x):
        return np.array([1.0, 0, 0, 0, 0, 0])
    value = small[y, x] / 255.0
    terms = quadratic(4.0 * x + 1.5, 4.0 * y + 1.5, image.shape)
    # Bare paper is the brightest: quantiles are fitted by weights of 9 to 1, a little pulled towards flatness.
    flat = np.diag([0.0, *np.full(5, 0.02 * len(x))])
    weight = np.ones(len(x))
    for _ in range(20):
        fit = np.linalg.solve((terms * weight[:, None]).T @ terms + flat, (terms * weight[:, None]).T @ value)
        off = value - terms @ fit
        weight = np.where(off > 0, 0.93, 0.07) / np.maximum(np.abs(off), 0.02)
    return fit


def quadratic(u: NDArray[np.floating], v: NDArray[np.floating], shape: tuple[int, ...]) -> Array:
    """1, u, v, u², uv, v² (n, 6) of px in a picture of that shape."""
    a, b = u / shape[1] - 0.5, v / shape[0] - 0.5
    return np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=-1)
