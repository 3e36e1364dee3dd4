"""Optical flow of points, forward and backward, led by a few well-spread guides."""

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.uint8]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

WINDOW_PX = 15
# The guides find the motion, the others only refine it. With all points on all levels, 21 % of kinect_paper's
# fail between frames 60 and 61 (its texture repeats), in 20 ms; led by guides, none, in 8 ms (one core).
GUIDES = 150
GUIDE_WINDOW_PX = 21
GUIDE_LEVELS = 4  # halvings of a picture 640 px wide
VOTES = 8  # guides whose median motion a point starts from
RETURN_PX = 1.0  # forward and backward again must end so near to the start


def spread_order(points_px: Array) -> Indices:
    """An order of the points (P, 2) of which every beginning covers them well (farthest first)."""
    distance = np.full(len(points_px), np.inf)
    order = np.zeros(len(points_px), np.int64)
    for i in range(1, len(points_px)):
        step = points_px - points_px[order[i - 1]]
        distance = np.minimum(distance, step[:, 0] ** 2 + step[:, 1] ** 2)
        order[i] = distance.argmax()
    return order


def follow(before: Image, now: Image, points_px: Array) -> Array:
    """Where points went from one picture to the next: (n, 2), NaN where they did not come back.

    Args:
        before: (H, W) uint8 picture.
        now: (H, W) uint8 picture after it.
        points_px: (n, 2) points in the first, in `spread_order`: the first `GUIDES` lead.
    """
    if len(points_px) == 0:  # OpenCV raises
        return np.empty((0, 2))
    guides = points_px[:GUIDES]
    levels = GUIDE_LEVELS + max(0, round(np.log2(max(now.shape) / 640.0)))
    moved, good = _both_ways(before, now, guides, np.zeros_like(guides), GUIDE_WINDOW_PX, levels)
    motion = (moved - guides)[good]
    if len(motion) < VOTES:
        guess = np.zeros_like(points_px)
    else:
        guess = _median_of_nearest(points_px, guides[good], motion)
        levels = 0
    there, good = _both_ways(before, now, points_px, guess, WINDOW_PX, levels)
    there[~good] = np.nan
    return there


def _both_ways(before: Image, now: Image, points: Array, guess: Array, window: int, levels: int) -> tuple[Array, Flags]:
    start = points.astype(np.float32)
    motion = guess.astype(np.float32)
    size, guessed = (window, window), cv2.OPTFLOW_USE_INITIAL_FLOW
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before, now, start, start + motion, winSize=size, maxLevel=levels, flags=guessed
    )
    back, returned, _ = cv2.calcOpticalFlowPyrLK(
        now, before, there, there - motion, winSize=size, maxLevel=levels, flags=guessed
    )
    good = (found[:, 0] > 0) & (returned[:, 0] > 0) & (np.linalg.norm(back - start, axis=1) < RETURN_PX)
    return np.asarray(there, np.float64), np.asarray(good, np.bool_)


def _median_of_nearest(points: Array, guides: Array, motion: Array) -> Array:
    # One product instead of all differences; the points' own squares do not change the order.
    near = guides.astype(np.float32)
    distance = np.sum(near**2, axis=1) - 2.0 * points.astype(np.float32) @ near.T
    nearest = np.argpartition(distance, VOTES - 1, axis=1)[:, :VOTES]
    median: Array = np.median(motion[nearest], axis=1)
    return median
