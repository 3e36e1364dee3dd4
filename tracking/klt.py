"""The point tracker: pyramidal Lucas-Kanade checked by appearance and neighbours, and re-acquisition."""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from tracking.appearance import Appearance
from tracking.consistency import LocalMotion, local_motion, nearest_neighbours

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Image = NDArray[np.uint8]
Picture = NDArray[np.float32]

WINDOW = (15, 15)
LEVELS = 3
FORWARD_BACKWARD_PX = 1.0
PATCH_RADIUS = 7
BORDER_PX = 4.0  # nearer to the border a point counts as having left
KEEP_SCORE = 0.5  # correlation with the reference below which a tracked point is given up
CORRECT_SCORE = 0.8  # ... above which its drift is removed
ACCEPT_SCORE = 0.75  # ... above which a lost point is taken up again
CORRECT_PX = 2.0  # larger "drift" is another place that looks alike
REACQUIRE_PX = 8.0  # how far from the prediction a lost point may be found
PREDICTION_WEIGHT = 0.2  # of a predicted neighbour against a seen one


@dataclass(frozen=True)
class Observation:
    """What one frame shows of the points.

    Attributes:
        points_px: (P, 2) image points W^f, NaN where not visible.
        visible: (P,) h^f.
    """

    points_px: Array
    visible: Flags


class PointTracker:
    """Follows points of a reference frame from frame to frame.

    Args:
        image_bgr: (H, W, 3) uint8 reference frame; what the points look like is taken from here.
        points_px: (P, 2) the points in it.
    """

    def __init__(self, image_bgr: Image, points_px: Array) -> None:
        gray = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY)
        self._gray = cast(Image, gray)
        self._reference = points_px.astype(np.float64)
        self._neighbours = nearest_neighbours(self._reference)
        fine, coarse = _pictures(self._gray)
        self._fine = Appearance(fine, self._reference, PATCH_RADIUS)
        self._coarse = Appearance(coarse, self._reference / 2.0, PATCH_RADIUS)
        self._points = self._reference.copy()
        self._affine = np.broadcast_to(np.eye(2), (len(points_px), 2, 2)).copy()

    def track(self, image_bgr: Image, predicted_px: Array | None = None) -> Observation:
        """Find the points in the next frame.

        Args:
            image_bgr: (H, W, 3) uint8, of the reference frame's size.
            predicted_px: (P, 2) where the model expects the points, NaN where it does not know; lost points
                are taken up again near there. None while there is no model: lost points stay lost.
        """
        gray = cast(Image, cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY))
        points = self._flow(gray)
        self._gray = gray
        motion = self._motion(points, predicted_px)
        points[~motion.consistent] = np.nan
        fine, coarse = _pictures(gray)
        points = self._refine(fine, points, motion)
        if predicted_px is not None:
            points = self._reacquire(fine, coarse, points, predicted_px, motion)
        height, width = gray.shape
        inside = (points >= BORDER_PX) & (points <= np.array([width, height]) - 1.0 - BORDER_PX)
        points[~inside.all(axis=1)] = np.nan
        self._points = points
        self._affine = motion.affine
        return Observation(points.copy(), np.isfinite(points[:, 0]))

    def _flow(self, gray: Image) -> Array:
        """The points seen in the last frame, by optical flow: (P, 2), NaN where lost."""
        points = np.full_like(self._points, np.nan)
        seen = np.flatnonzero(np.isfinite(self._points[:, 0]))
        if len(seen) == 0:  # OpenCV raises
            return points
        start = self._points[seen].astype(np.float32)
        there, found, _ = cv2.calcOpticalFlowPyrLK(
            self._gray, gray, start, start.copy(), winSize=WINDOW, maxLevel=LEVELS
        )
        back, returned, _ = cv2.calcOpticalFlowPyrLK(
            gray, self._gray, there, there.copy(), winSize=WINDOW, maxLevel=LEVELS
        )
        good = (found[:, 0] > 0) & (returned[:, 0] > 0)
        good &= np.linalg.norm(back - start, axis=1) < FORWARD_BACKWARD_PX
        points[seen[good]] = there[good]
        return points

    def _motion(self, points: Array, predicted_px: Array | None) -> LocalMotion:
        weight = np.isfinite(points[:, 0]).astype(np.float64)
        if predicted_px is not None:
            helped = (weight == 0) & np.isfinite(predicted_px[:, 0])
            points = np.where(helped[:, None], predicted_px, points)
            weight[helped] = PREDICTION_WEIGHT
        return local_motion(self._reference, points, weight, self._neighbours, self._affine)

    def _refine(self, fine: Picture, points: Array, motion: LocalMotion) -> Array:
        """Remove the drift of tracked points; drop those that look different."""
        points = points.copy()
        seen = np.flatnonzero(np.isfinite(points[:, 0]))
        affine = motion.affine[seen]
        flow = self._fine.align(fine, points[seen], affine, seen, 0)
        aligned = self._fine.align(fine, points[seen], affine, seen, 2)
        moved = np.linalg.norm(aligned.points_px - points[seen], axis=1)
        better = (aligned.score > np.maximum(flow.score, CORRECT_SCORE)) & (moved < CORRECT_PX)
        points[seen[better]] = aligned.points_px[better]
        points[seen[np.where(better, aligned.score, flow.score) < KEEP_SCORE]] = np.nan
        return points

    def _reacquire(
        self, fine: Picture, coarse: Picture, points: Array, predicted_px: Array, motion: LocalMotion
    ) -> Array:
        """Find lost points again near their prediction: looks right, and moves like the neighbours."""
        lost = np.flatnonzero(np.isnan(points[:, 0]) & np.isfinite(predicted_px).all(axis=1))
        expected = (predicted_px + self._correction(points, predicted_px))[lost]
        affine = motion.affine[lost]
        rough = self._coarse.align(coarse, expected / 2.0, affine, lost, 3).points_px * 2.0
        found = self._fine.align(fine, rough, affine, lost, 3)
        near = np.linalg.norm(found.points_px - expected, axis=1) < REACQUIRE_PX
        good = near & (found.score > ACCEPT_SCORE)
        points = points.copy()
        points[lost[good]] = found.points_px[good]
        agreed = self._motion(points, None).consistent
        points[lost[~agreed[lost]]] = np.nan
        return points

    def _correction(self, points: Array, predicted_px: Array) -> Array:
        """How far the prediction misses around each point: (P, 2), from the neighbours that are seen."""
        miss = points - predicted_px
        known = np.isfinite(miss[:, 0])
        if not known.any():
            return np.zeros_like(points)
        filled = np.where(known[:, None], miss, 0.0)
        count = known[self._neighbours].sum(axis=1)[:, None]
        local = filled[self._neighbours].sum(axis=1) / np.maximum(count, 1)
        return np.where(count > 0, local, np.median(miss[known], axis=0))


def _pictures(gray: Image) -> tuple[Picture, Picture]:
    """The picture and its half, as float32."""
    fine = gray.astype(np.float32)
    return fine, cast(Picture, cv2.pyrDown(fine))
