"""The sample: a video of a printed sheet that is turned, bent and waved, with the true shape of every frame.

    sample()           the files, made on first use
    render(frame)      one picture, with or without the hand
    true_shape(frame)  where the points of grid() are in it

page.png is printed on the sheet, motion is the sheet's shape, desk.png and hand are what else is in view, camera takes
the pictures, store keeps the files.
"""

from app.demo.camera import SIZE, K, occluder, project, render, sheet_at, true_shape
from app.demo.motion import FPS, FRAMES, RIGID_FRAMES, grid, surface
from app.demo.store import TRUTH_EVERY, Sample, sample

__all__ = [
    "FPS",
    "FRAMES",
    "RIGID_FRAMES",
    "SIZE",
    "TRUTH_EVERY",
    "K",
    "Sample",
    "grid",
    "occluder",
    "project",
    "render",
    "sample",
    "sheet_at",
    "surface",
    "true_shape",
]
