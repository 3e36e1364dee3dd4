"""A printed sheet before a wall, and a compositor for it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from app.painting.compositing import Compositor
from app.painting.picture import premultiplied
from app.painting.placement import Placement
from reconstruction.basis.mesh import triangulate

Image = NDArray[np.uint8]
SIZE = (320, 240)
BOX = (60, 50, 200, 140)  # the sheet: left, top, width, height
GRID = np.stack(np.meshgrid(np.linspace(60, 259, 16), np.linspace(50, 189, 12)), axis=-1).reshape(-1, 2)


def jittered() -> NDArray[np.float64]:
    low, high = GRID.min(axis=0), GRID.max(axis=0)
    movable = ((low < GRID) & (high > GRID)).all(axis=1)
    return GRID + movable[:, None] * np.random.default_rng(0).uniform(-4, 4, GRID.shape)


POINTS = jittered()
MESH = triangulate(POINTS)
AHEAD = np.full(len(POINTS), 300.0)


def scene() -> Image:
    """A print on white paper, before a green wall."""
    rng = np.random.default_rng(1)
    image = np.full((*SIZE[::-1], 3), (60, 120, 60), np.uint8)
    x, y, w, h = BOX
    image[y : y + h, x : x + w] = 235
    for _ in range(160):
        px, py = rng.integers((x + 4, y + 4), (x + w - 12, y + h - 10))
        colour = tuple(int(c) for c in rng.integers(0, 200, 3))
        cv2.rectangle(image, (int(px), int(py)), (int(px) + int(rng.integers(2, 9)), int(py) + 4), colour, -1)
    noise = rng.normal(0, 1.5, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.6) + noise, 0, 255).astype(np.uint8)


SCENE = scene()
GREY = premultiplied(np.full((50, 80, 3), (200, 120, 90), np.uint8))


def compositor(placement: Placement | None = None) -> Compositor:
    return Compositor(SCENE, POINTS, MESH, perspective=True, placement=placement)


def paint(work: Compositor, image: Image, picture: Image = GREY, observed: NDArray[np.float64] = POINTS) -> Image:
    return work.paint(image, picture, POINTS, AHEAD, observed)


def inner(margin: int = 4) -> tuple[slice, slice]:
    x, y, w, h = BOX
    return slice(y + margin, y + h - margin), slice(x + margin, x + w - margin)
