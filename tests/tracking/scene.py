"""A textured surface that moves in a known way."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Motion = Callable[[Array], Array]

SIZE = (320, 240)


def texture(seed: int = 0, size: tuple[int, int] = SIZE) -> Image:
    """(H, W, 3) random blobs of several sizes."""
    rng = np.random.default_rng(seed)
    layers = [cv2.GaussianBlur(rng.normal(0.0, s, size[::-1]), (0, 0), s) for s in (1.5, 3.0, 8.0)]
    total = np.sum(layers, axis=0)
    gray = np.clip(128.0 + 45.0 * total / total.std(), 0, 255).astype(np.uint8)
    return cv2.cvtColor(gray, cv2.COLOR_GRAY2BGR)


def moved(image: Image, backward: Motion) -> Image:
    """The picture whose pixel x shows what was at `backward(x)`."""
    height, width = image.shape[:2]
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    source = backward(np.stack([x.ravel(), y.ravel()], axis=1)).astype(np.float32)
    source = source.reshape(height, width, 2)
    return cv2.remap(image, source[..., 0], source[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def tilt(k: float) -> tuple[Motion, Motion]:
    """Forward and backward motion of a surface that turns, shrinks to one side and wanders."""
    c, s = np.cos(0.25 * k), np.sin(0.25 * k)
    A = np.array([[c, -s], [s, c]]) @ np.array([[1.0 - 0.35 * k, 0.1 * k], [0.0, 1.0]])
    centre, shift = np.array(SIZE) / 2.0, k * np.array([9.0, -6.0])
    inverse = np.linalg.inv(A)
    return (
        lambda p: (p - centre) @ A.T + centre + shift,
        lambda p: (p - centre - shift) @ inverse.T + centre,
    )
