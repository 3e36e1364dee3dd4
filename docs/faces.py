"""Makes docs/faces.png: rest shapes from the front and from both sides.

modeshape run talking_face.mp4 --shapes-out talking.npz    # and another
python -m docs.faces talking.npz turning.npz
"""

import sys
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIDES_DEG = (-70, -35, 0, 35, 70)
LIGHT = np.array([0.3, -0.5, -0.8])
PALETTE = 64  # grey levels


def seen_from(shape: Array, degrees: float) -> Array:
    """A shape (3, p), x right, y down, z away, turned about the upright axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ (shape - shape.mean(axis=1, keepdims=True))


def draw(axes: Axes, shape: Array, faces: NDArray[np.int64]) -> None:
    """Draw triangles (m, 3) of a shape (3, p), the farthest first, lit from above."""
    a, b, c = (shape[:, faces[:, k]].T for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True).clip(1e-12)
    normal *= -np.sign(normal[:, 2:]) + (normal[:, 2:] == 0)  # towards the eye
    grey = 0.15 + 0.85 * (normal @ (LIGHT / np.linalg.norm(LIGHT))).clip(0)
    order = np.argsort(-shape[2, faces].mean(axis=1))
    axes.add_collection(PolyCollection(np.stack([a, b, c], axis=1)[order, :, :2], facecolors=plt.cm.gray(grey[order])))
    axes.set(xlim=(shape[0].min(), shape[0].max()), ylim=(shape[1].max(), shape[1].min()), aspect="equal")
    axes.axis("off")


def main() -> None:
    """A row for each file of shapes."""
    files = [np.load(path) for path in sys.argv[1:]]
    figure, rows = plt.subplots(len(files), len(SIDES_DEG), figsize=(7.5, 2.2 * len(files)), squeeze=False)
    for file, row in zip(files, rows, strict=True):
        for axes, degrees in zip(row, SIDES_DEG, strict=True):
            draw(axes, seen_from(file["rest"], degrees), file["faces"])
    figure.subplots_adjust(0, 0, 1, 1, 0.02, 0.02)
    figure.canvas.draw()
    image = cv2.cvtColor(np.asarray(figure.canvas.buffer_rgba()), cv2.COLOR_RGBA2GRAY)
    cv2.imwrite(str(Path(__file__).parent / "faces.png"), image // (256 // PALETTE) * (256 // PALETTE))


if __name__ == "__main__":
    main()
