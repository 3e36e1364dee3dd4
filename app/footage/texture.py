"""Texture that has nothing to do with the surface."""

from functools import cache

import cv2
import numpy as np

from app.arrays import Image

BLOBS_PX = (1.5, 3.0, 8.0)


@cache
def texture(width: int, height: int, seed: int) -> Image:
    """Coloured blobs of several sizes, (height, width, 3); the same seed gives the same."""
    rng = np.random.default_rng(seed)
    layers = [cv2.GaussianBlur(rng.normal(0.0, sigma, (height, width, 3)), (0, 0), sigma) for sigma in BLOBS_PX]
    total = np.sum(layers, axis=0)
    return np.clip(125.0 + 45.0 * total / total.std(), 0, 255).astype(np.uint8)
