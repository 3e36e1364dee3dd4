"""How the camera moves, by what is at the picture's border."""

from collections.abc import Sequence

import cv2
import numpy as np

from tracking import Array, Flags

BAND = 0.15  # of the picture's sides: points so near to its border are of what is behind
FEWEST = 8  # of them at a side that tells
SIDES = 3  # that must tell the same: a head hides one
OFF_PX = 2.0  # from where the camera's motion takes them, points are not of it
AGREED = 0.6  # of the points at the border must be of it, and half of those at a side
STILL_PX = 2.0  # a camera by which the border moves less stands still


def by_first_camera(tracks: Sequence[Array], size: tuple[int, int]) -> list[Array]:
    """Tracks (P, 2) px each as the camera of the first would have seen them, were all of it as far as what is behind.

    As they are where the border does not move, or not as one.

    Args:
        tracks: NaN where not seen.
        size: width and height of the picture.
    """
    sides = at_sides(tracks[0], size)
    return [undone(tracks[0], now, sides) for now in tracks]


def at_sides(points: Array, size: tuple[int, int]) -> Flags:
    """Which points (P, 2) px are near the left, upper, right and lower border, (4, P)."""
    extent = np.array(size)
    near = np.stack([points, extent - 1 - points]) < BAND * extent
    return np.asarray(near.transpose(0, 2, 1).reshape(4, -1))


def undone(first: Array, now: Array, sides: Flags) -> Array:
    """Points now (P, 2) px without the camera's motion since they were at first (P, 2)."""
    seen = np.isfinite(now[:, 0])
    told = sides & seen
    band = told.any(axis=0)
    if (told.sum(axis=1) >= FEWEST).sum() < SIDES:
        return now
    H, inlier = cv2.findHomography(now[band], first[band], cv2.RANSAC, OFF_PX)
    if H is None:
        return now
    agrees = np.zeros(len(first), np.bool_)
    agrees[band] = inlier[:, 0] > 0
    by_side = (told & agrees).sum(axis=1) >= np.maximum(0.5 * told.sum(axis=1), FEWEST)
    if by_side.sum() < SIDES or agrees.sum() < AGREED * band.sum():
        return now
    if np.median(np.linalg.norm(now - first, axis=1)[agrees]) < STILL_PX:
        return now
    back = np.full_like(now, np.nan)
    back[seen] = cv2.perspectiveTransform(now[seen][None], H)[0]
    return back
