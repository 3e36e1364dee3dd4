"""Optical flow of points, checked forward and backward, and started from the motion of a few well-spread guides."""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from tracking import Array, Flags, Image, Indices

WINDOW_PX = 15
# The guides find the motion, the others only refine it. With all points on all levels, 21 % of kinect_paper's
# fail between frames 60 and 61 (its texture repeats), in 20 ms; led by guides, none, in 8 ms (one core). Guides are
# followed in the half picture, which is as good a guide at a quarter of the cost. Dense flow (DIS, ultrafast) as the guide
# brings 97.7 % of 1,475 points back in 9.4 ms, these guides 98.1 % in 8.7 ms.
GUIDES = 150
GUIDE_WINDOW_PX = 11  # of the half picture
GUIDE_LEVELS = 3  # halvings of a half picture 320 px wide
NEAREST_GUIDES = 8  # guides whose median motion a point starts from
RETURN_PX = 1.0  # forward and backward again must end so near to the start
CONVERGED_PX, RETURN_CONVERGED_PX = 0.03, 0.1  # shorter steps end the search; alignment to appearance follows
MOST_STEPS = 30


@dataclass(frozen=True)
class Grays:
    """A picture to follow points through.

    Attributes:
        full: (H, W) uint8.
        half: half its size.
    """

    full: Image
    half: Image

    @classmethod
    def of(cls, image_bgr: Image) -> "Grays":
        """Of a picture (H, W, 3) uint8."""
        gray = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY)
        return cls(cast(Image, gray), cast(Image, cv2.pyrDown(gray)))


def spread_order(points_px: Array) -> Indices:
    """An order of the points (P, 2) of which every beginning covers them well (farthest first)."""
    distance = np.full(len(points_px), np.inf)
    order = np.zeros(len(points_px), np.int64)
    for i in range(1, len(points_px)):
        step = points_px - points_px[order[i - 1]]
        distance = np.minimum(distance, step[:, 0] ** 2 + step[:, 1] ** 2)
        order[i] = distance.argmax()
    return order


def follow(before: Grays, now: Grays, points_px: Array) -> Array:
    """Where points went from one picture to the next: (n, 2), NaN where they did not come back.

    Args:
        before: a picture.
        now: the picture after it, of the same size.
        points_px: (n, 2) points in the first, in `spread_order`: the first `GUIDES` lead.
    """
    if len(points_px) == 0:  # OpenCV raises
        return np.empty((0, 2))
    guides = points_px[:GUIDES]
    levels = GUIDE_LEVELS + max(0, round(np.log2(max(now.half.shape) / 320.0)))
    moved, good = both_ways(before.half, now.half, guides / 2, np.zeros_like(guides), GUIDE_WINDOW_PX, levels)
    motion = (2 * moved - guides)[good]
    if len(motion) < NEAREST_GUIDES:
        guess = np.zeros_like(points_px)
        levels += 1
    else:
        guess = _median_of_nearest(points_px, guides[good], motion)
        levels = 0
    there, good = both_ways(before.full, now.full, points_px, guess, WINDOW_PX, levels)
    there[~good] = np.nan
    return there


def both_ways(before: Image, now: Image, points: Array, guess: Array, window: int, levels: int) -> tuple[Array, Flags]:
    """Points (n, 2) by Lucas-Kanade from guesses of their motion (n, 2), and whether they come back to where they were."""
    start = points.astype(np.float32)
    motion = guess.astype(np.float32)
    size, guessed = (window, window), cv2.OPTFLOW_USE_INITIAL_FLOW
    until = cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before,
        now,
        start,
        start + motion,
        winSize=size,
        maxLevel=levels,
        flags=guessed,
        criteria=(until, MOST_STEPS, CONVERGED_PX),
    )
    back, returned, _ = cv2.calcOpticalFlowPyrLK(
        now,
        before,
        there,
        there - motion,
        winSize=size,
        maxLevel=levels,
        flags=guessed,
        criteria=(until, MOST_STEPS, RETURN_CONVERGED_PX),
    )
    good = (found[:, 0] > 0) & (returned[:, 0] > 0) & (np.linalg.norm(back - start, axis=1) < RETURN_PX)
    return np.asarray(there, np.float64), np.asarray(good, np.bool_)


def _median_of_nearest(points: Array, guides: Array, motion: Array) -> Array:
    near, far = guides.astype(np.float32), points.astype(np.float32)
    nearest = cv2.batchDistance(far, near, cv2.CV_32F, normType=cv2.NORM_L2SQR, K=NEAREST_GUIDES)[1]
    return cast(
        Array, np.sort(motion.T[:, nearest], axis=2)[:, :, NEAREST_GUIDES // 2 - 1 : NEAREST_GUIDES // 2 + 1].mean(axis=2).T
    )
