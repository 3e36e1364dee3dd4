"""Part 6: painting a picture on the mesh, in a frame of 640×480."""

import cv2
import numpy as np

from app.arrays import Image
from app.bench.timing import Log, least_s
from app.painting.compositing import Compositor
from app.painting.picture import premultiplied
from reconstruction.basis.mesh import triangulate

SIZE = (640, 480)
GRID = (32, 25)  # of points: 800
COLUMNS_PX, ROWS_PX = (155, 480), (110, 370)  # of the sheet
PICTURE = (900, 1200, 3)
BUDGET_S = 1.5


def paint_ms(log: Log) -> float:
    """Milliseconds of one core for a frame: colours, light and occlusion mask."""
    log("painting a picture")
    rng = np.random.default_rng(0)
    (left, right), (top, bottom) = COLUMNS_PX, ROWS_PX
    grid = np.meshgrid(np.linspace(left, right, GRID[0]), np.linspace(top, bottom, GRID[1]))
    points = np.stack(grid, axis=-1).reshape(-1, 2) + rng.uniform(-3, 3, (GRID[0] * GRID[1], 2))
    frame = textured(rng)
    compositor = Compositor(frame, points, triangulate(points), perspective=True)
    picture = premultiplied(rng.integers(0, 255, PICTURE, np.uint8))
    depth = 600 + 40 * np.sin(points[:, 0] / 50)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        (seconds,) = least_s(lambda: compositor.paint(frame, picture, points, depth, points), budget_s=BUDGET_S)
    finally:
        cv2.setNumThreads(threads)
    return 1e3 * seconds


def textured(rng: np.random.Generator) -> Image:
    """A frame that shows blotches of all sizes."""
    image = np.zeros((SIZE[1], SIZE[0], 3))
    for blotch_px in (4, 16, 64):
        coarse = rng.uniform(0, 85, (SIZE[1] // blotch_px, SIZE[0] // blotch_px, 3))
        image += cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)
    return image.clip(0, 255).astype(np.uint8)
