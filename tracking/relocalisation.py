"""Relocalisation: a surface found anywhere in a picture, by features matched to the reference frame."""

from typing import cast

import cv2
import numpy as np

from tracking import Array, Flags, Floats, Image, Indices

SIDE_PX = 960  # larger pictures are halved for matching
FEATURES = 1200  # most in the reference's surface
PICTURE_FEATURES = 2500  # most in another picture, which shows more than the surface
RATIO = 0.8  # of the distances to the best and the second best match (Lowe 2004)
AFFINE_ERROR = 0.08  # of the surface's extent: how far a bent surface may be off one affine map
LOCAL_ERROR = 0.03  # of the extent: how far a match may be off its neighbours'
INFLUENCE = 0.12  # of the extent: standard deviation of the weight of a match around it
ROUNDS = 3  # of rejecting matches by their neighbours
AROUND = 0.2  # of the extent, around the places near which the surface is looked for
MIN_MATCHES = 15  # fewer may agree by chance
SCALES = (0.2, 5.0)  # between the smallest and the largest stretch of the affine map, against the reference


class Relocalisation:
    """Finds the surface of a reference frame in any picture.

    Args:
        image_bgr: (H, W, 3) uint8 reference frame.
        points_px: (P, 2) points that cover the surface in it.
    """

    def __init__(self, image_bgr: Image, points_px: Array) -> None:
        self._points = points_px
        self._extent = float(np.sqrt(2.0 * np.var(points_px, axis=0).sum())) * 2.0
        mask = np.zeros(image_bgr.shape[:2], np.uint8)
        hull = cv2.convexHull(points_px.astype(np.float32).reshape(-1, 1, 2))
        cv2.fillConvexPoly(mask, np.rint(hull).astype(np.int32), (255,))
        scale = min(1.0, SIDE_PX / max(mask.shape))
        left, top, right, bottom = _around(points_px, AROUND * self._extent, image_bgr.shape)
        cut, mask = image_bgr[top:bottom, left:right], mask[top:bottom, left:right]
        self._places, self._described = self._features(cut, cv2.SIFT.create(FEATURES), mask, scale)
        self._places += (left, top)

    def find(self, image_bgr: Image, side_px: int = SIDE_PX, near_px: Array | None = None) -> Array | None:
        """Where the points are in a picture, to some pixels: (P, 2), NaN where no match is near; None if nowhere.

        Args:
            image_bgr: (H, W, 3) uint8.
            side_px: larger pictures are made smaller: to save time.
            near_px: (n, 2) places around which features are looked for: to save time; None is everywhere.
        """
        scale = min(1.0, side_px / max(image_bgr.shape))
        left, top, right, bottom = _around(near_px, AROUND * self._extent, image_bgr.shape)
        cut = image_bgr[top:bottom, left:right]
        places, described = self._features(cut, cv2.SIFT.create(PICTURE_FEATURES), None, scale)
        places += (left, top)
        if len(places) < MIN_MATCHES or len(self._places) < MIN_MATCHES:
            return None
        best, distance, second = _nearest_two(self._described, described)
        pairs = np.flatnonzero(distance < RATIO**2 * second)
        if len(pairs) < MIN_MATCHES:
            return None
        there, here = self._places[pairs], places[best[pairs]]
        affine, agree = cv2.estimateAffine2D(there, here, ransacReprojThreshold=AFFINE_ERROR * self._extent, maxIters=4000)
        if affine is None or int(agree.sum()) < MIN_MATCHES:
            return None
        stretch = np.linalg.svd(affine[:, :2], compute_uv=False)
        if stretch[1] < SCALES[0] or stretch[0] > SCALES[1]:
            return None
        return self._bent(there, here, np.asarray(affine, np.float64), agree[:, 0] > 0)

    def _bent(self, there: Array, here: Array, affine: Array, agree: Flags) -> Array | None:
        """The points under an affine map bent to the matches around each."""
        off = here - _mapped(affine, there)
        near = self._influence(there, there)
        np.fill_diagonal(near, 0.0)  # no match speaks for itself
        size = float(np.sqrt(abs(np.linalg.det(affine[:, :2])))) * self._extent
        for _ in range(ROUNDS):
            local, weight = _mean(near * agree, off)
            alike = np.linalg.norm(off - local, axis=1) < LOCAL_ERROR * size
            agree = np.where(weight > 1.0, alike, agree) & (np.linalg.norm(off, axis=1) < 2.0 * AFFINE_ERROR * size)
            if agree.sum() < MIN_MATCHES:
                return None
        local, weight = _mean(self._influence(self._points, there[agree]), off[agree])
        return np.where(weight[:, None] > 1e-3, _mapped(affine, self._points) + local, np.nan)

    def _influence(self, at: Array, there: Array) -> Array:
        """Weights (n, m) at n places of what is known at m, in px of the reference."""
        squared = (at**2).sum(axis=1)[:, None] + (there**2).sum(axis=1) - 2.0 * at @ there.T
        return np.asarray(np.exp(-0.5 * squared / (INFLUENCE * self._extent) ** 2))

    def _features(self, image_bgr: Image, sift: cv2.SIFT, mask: Image | None, scale: float) -> tuple[Array, Floats]:
        gray = cv2.cvtColor(image_bgr, cv2.COLOR_BGR2GRAY)
        if scale < 1.0:
            gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            mask = None if mask is None else cast(Image, cv2.resize(mask, gray.shape[::-1]))
        found, described = sift.detectAndCompute(gray, cast(Image, mask))
        if described is None:
            return np.empty((0, 2)), np.empty((0, 128), np.float32)
        places = np.array([feature.pt for feature in found], np.float64)
        return (places + 0.5) / scale - 0.5, cast(Floats, described)


def _mean(weights: Array, values: Array) -> tuple[Array, Array]:
    """Weighted means (n, 2) of values (m, 2) by weights (n, m), and the sums (n,) of these."""
    total = weights.sum(axis=1)
    return weights @ values / np.maximum(total, 1e-12)[:, None], total


def _nearest_two(ours: Floats, theirs: Floats) -> tuple[Indices, Floats, Floats]:
    """Of descriptors (m, 128) the nearest to each of (n, 128), and the squared distances to it and to the next (n,)."""
    squared = (theirs**2).sum(axis=1) - 2.0 * (ours @ theirs.T)  # integers below 2^24: exact
    rows, best = np.arange(len(ours)), squared.argmin(axis=1)
    nearest = squared[rows, best]
    squared[rows, best] = np.inf
    own = (ours**2).sum(axis=1)
    return best, nearest + own, squared.min(axis=1) + own


def _mapped(affine: Array, points: Array) -> Array:
    """Points (n, 2) under a map (2, 3)."""
    return points @ affine[:, :2].T + affine[:, 2]


def _around(points_px: Array | None, margin_px: float, shape: tuple[int, ...]) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the part of a picture around points (n, 2), NaN if unknown; without any, all of it."""
    height, width = shape[:2]
    known = np.empty((0, 2)) if points_px is None else points_px[np.isfinite(points_px).all(axis=1)]
    if len(known):
        left, top = (known.min(axis=0) - margin_px).clip(0, (width, height)).astype(int).tolist()
        right, bottom = (known.max(axis=0) + margin_px).clip(0, (width, height)).astype(int).tolist()
        if min(right - left, bottom - top) > margin_px:
            return left, top, right, bottom
    return 0, 0, width, height
