"""Optical flow of points, checked forward and backward, and started from the motion of a few well-spread guides."""

from dataclasses import dataclass
from functools import cached_property
from typing import cast

import cv2
import numpy as np

from tracking import Array, Flags, Image, Indices

WINDOW_PX = 15
# The guides find the motion, the others only refine it. With all points on all levels, 21 % of kinect_paper's
# fail between frames 60 and 61 (its texture repeats), in 20 ms; led by guides, none, in 8 ms (one core). Guides are
# followed in the half picture, or a smaller one if that is large, which is as good a guide at a quarter of the cost. Dense
# flow (DIS, ultrafast) as the guide brings 97.7 % of 1,475 points back in 9.4 ms, these guides 98.1 % in 8.7 ms.
GUIDES = 150
GUIDE_WINDOWS_PX = (11, 31)  # of the small picture; the second for those that do not come back with the first
SMALL_PX, LEVELS = 320, 3  # a picture so wide is halved so many times more
NEAREST_GUIDES = 8  # guides whose median motion a point starts from
FEW_GUIDES = 0.7  # of the guides: come fewer back, the light may have changed
LIGHT = 0.15  # the usual change of brightness at a guide, as a share: noise makes up to 0.1 of it, more is light
EVENED_PX = 31  # side of the squares over which light is evened out: smaller than bands of light, larger than a window
EVENED_NOISE = 4.0  # grey levels of contrast, below which there is nothing to be evened
GUESSED_PX = 1.0  # what ends so near to where its guides went needs not come back
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

    @cached_property
    def small(self) -> tuple[Image, int]:
        """The picture to follow guides in, at most half as large, and how many of its pixels are one."""
        picture, scale = self.half, 2
        while max(picture.shape) > np.sqrt(2) * SMALL_PX:
            picture, scale = cast(Image, cv2.pyrDown(picture)), 2 * scale
        return picture, scale

    @cached_property
    def evened(self) -> "Grays":
        """The same without the light: each pixel against the mean of those around it, by their contrast."""
        gray, side = self.full.astype(np.float32), (EVENED_PX, EVENED_PX)
        mean = cv2.blur(gray, side)
        contrast = np.sqrt((cv2.sqrBoxFilter(gray, cv2.CV_32F, side) - mean**2).clip(EVENED_NOISE**2))
        full = cv2.convertScaleAbs(128.0 + 48.0 * (gray - mean) / contrast)
        return Grays(cast(Image, full), cast(Image, cv2.pyrDown(full)))


def spread_order(points_px: Array) -> Indices:
    """An order of the points (P, 2) of which every beginning covers them well (farthest first)."""
    distance = np.full(len(points_px), np.inf)
    order = np.zeros(len(points_px), np.int64)
    for i in range(1, len(points_px)):
        step = points_px - points_px[order[i - 1]]
        distance = np.minimum(distance, step[:, 0] ** 2 + step[:, 1] ** 2)
        order[i] = distance.argmax()
    return order


class Flow:
    """Where the points of a reference frame go from one picture to the next, led by the motion of a few guides among them.

    Args:
        reference_px: (P, 2) the points in the reference frame.
    """

    def __init__(self, reference_px: Array) -> None:
        self._reference = reference_px.astype(np.float32)
        self._order = spread_order(reference_px)
        self._guides: Indices = np.empty(0, np.int64)
        self._nearest: Indices = np.empty((len(reference_px), 0), np.int64)  # guides to each point, in the reference frame

    def follow(self, before: Grays, now: Grays, points_px: Array) -> Array:
        """Where points (P, 2) went from one picture to the next of the same size; NaN stays, and where there is none."""
        moved = np.full_like(points_px, np.nan)
        seen = np.flatnonzero(np.isfinite(points_px[:, 0]))
        if len(seen) == 0:  # OpenCV raises
            return moved
        motion, share, light = self._guess(before, now, points_px)
        if share < FEW_GUIDES or light > LIGHT:  # a change of light is no motion
            its_motion, its_share, _ = self._guess(before.evened, now.evened, points_px)
            if its_share >= FEW_GUIDES:
                before, now, motion = before.evened, now.evened, its_motion
        motion, levels = motion[seen], 0
        if not np.isfinite(motion[0, 0]):
            motion, levels = np.zeros_like(motion), levels_of(now.full)
        start = points_px[seen]
        there, good = lucas_kanade(before.full, now.full, start, motion, WINDOW_PX, levels, CONVERGED_PX)
        far = np.flatnonzero(np.linalg.norm(there - start - motion, axis=1) > GUESSED_PX)
        good[far] &= returned(before.full, now.full, start[far], there[far], motion[far], WINDOW_PX, levels)
        moved[seen[good]] = there[good]
        return moved

    def _guess(self, before: Grays, now: Grays, points_px: Array) -> tuple[Array, float, float]:
        """The median motion of the guides nearest to each point in the reference frame: (P, 2); NaN if they are few.

        And the share of the guides that came back, and by how much their brightness has changed, as a share: the median.
        """
        (old, scale), (new, _) = before.small, now.small
        levels = levels_of(new)
        guides = self._order[np.isfinite(points_px[self._order, 0])][:GUIDES]
        start = points_px[guides] / scale
        moved, good = np.zeros_like(start), np.zeros(len(start), np.bool_)
        for window in GUIDE_WINDOWS_PX:
            left = np.flatnonzero(~good)
            still = np.zeros((len(left), 2))
            if len(left):
                moved[left], found = lucas_kanade(old, new, start[left], still, window, levels, CONVERGED_PX)
                good[left] = found & returned(old, new, start[left], moved[left], still, window, levels)
        light = change_of_light(old, new, start[good], moved[good])
        guides, motion = guides[good], scale * (moved - start)[good]
        if len(guides) < NEAREST_GUIDES:
            return np.full_like(points_px, np.nan), 0.0, 0.0
        if not np.array_equal(guides, self._guides):  # seldom
            nearest = cv2.batchDistance(
                self._reference, self._reference[guides], cv2.CV_32F, normType=cv2.NORM_L2SQR, K=NEAREST_GUIDES
            )[1]
            self._guides, self._nearest = guides, np.asarray(nearest, np.int64)
        middle = slice(NEAREST_GUIDES // 2 - 1, NEAREST_GUIDES // 2 + 1)
        return (
            cast(Array, np.sort(motion.T[:, self._nearest], axis=2)[:, :, middle].mean(axis=2).T),
            float(good.mean()),
            light,
        )


def change_of_light(before: Image, now: Image, start: Array, there: Array) -> float:
    """By how much points (n, 2) are brighter or darker where they went (n, 2), as a share: the median; 0 of none."""
    if len(start) == 0:
        return 0.0
    old, new = (
        image[
            np.rint(at[:, 1]).astype(int).clip(0, image.shape[0] - 1),
            np.rint(at[:, 0]).astype(int).clip(0, image.shape[1] - 1),
        ]
        for image, at in ((before, start), (now, there))
    )
    return float(np.median(np.abs(np.log((new + 8.0) / (old + 8.0)))))  # what is black has no share


def levels_of(picture: Image) -> int:
    """Halvings of a picture in which what moves far is followed."""
    return LEVELS + max(0, round(np.log2(max(picture.shape) / SMALL_PX)))


def lucas_kanade(
    before: Image, now: Image, points: Array, motion: Array, window: int, levels: int, converged_px: float
) -> tuple[Array, Flags]:
    """Where points (n, 2) went, from guesses of their motion (n, 2), and whether that is known (n,)."""
    start = points.astype(np.float32)
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before,
        now,
        start,
        start + motion.astype(np.float32),
        winSize=(window, window),
        maxLevel=levels,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        criteria=(cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, MOST_STEPS, converged_px),
    )
    return np.asarray(there, np.float64), np.asarray(found[:, 0] > 0, np.bool_)


def returned(before: Image, now: Image, points: Array, moved: Array, motion: Array, window: int, levels: int) -> Flags:
    """Whether points (n, 2) come back from where they went (n, 2).

    The guess of their motion (n, 2) is the same as for the way there: from what was found, they always would.
    """
    if len(points) == 0:
        return np.zeros(0, np.bool_)
    back, found = lucas_kanade(now, before, moved, -motion, window, levels, RETURN_CONVERGED_PX)
    return found & (np.linalg.norm(back - points, axis=1) < RETURN_PX)
