"""How the camera moves, by what is at the picture's border."""

from collections.abc import Sequence

import cv2
import numpy as np

from tracking import Array, Flags

BAND = 0.15  # of the picture's sides: points so near to its border are of what is behind
SECTORS, AGREEING = 8, 5  # of the picture's border, and how many must tell the same: head and shoulders hide three
FEWEST = 4  # points of one that tells
OFF_PX = 2.0  # from where the camera's motion takes them, points are not of it
TRIALS = 200  # of four points that are of it: enough where it has a third of them
AGREED = 0.75  # of the points at the border must be of it, and half of those in a sector: of a sheet that bends fewer are
STILL_PX = 2.0  # what moves less stands still


def by_first_camera(tracks: Sequence[Array], size: tuple[int, int], agreed: float = AGREED) -> tuple[list[Array], float]:
    """Tracks (P, 2) px each as the camera of the first would have seen them, were all of it as far as what is behind.

    As they are where the border does not move, or not as one in all frames: then what is there may bend.

    Args:
        tracks: NaN where not seen.
        size: width and height of the picture.
        agreed: so many of the points at the border must be of it.

    Returns:
        The tracks; how far the camera's motion took its border in the frame where it was farthest, px.
    """
    sectors = by_sector(tracks[0], np.array(size))
    motions = [motion(tracks[0], now, sectors, agreed) for now in tracks[1:]]
    known = [one for one in motions if one is not None]
    moved_px = max((px for _, px in known), default=0.0)
    if len(known) < len(motions) or moved_px < STILL_PX:
        return list(tracks), 0.0
    return [tracks[0], *(undone(now, H) for now, (H, _) in zip(tracks[1:], known, strict=True))], moved_px


def at_border(points: Array, size: Array) -> Flags:
    """Which points (P, 2) px are near the border of a picture, (P,)."""
    return np.asarray(np.abs((points + 0.5) / size - 0.5).max(axis=1) > 0.5 - BAND)


def by_sector(points: Array, size: Array) -> Flags:
    """The same by the direction from the picture's middle, (SECTORS, P)."""
    x, y = ((points + 0.5) / size - 0.5).T
    direction = np.floor(np.arctan2(y, x) / (2 * np.pi) * SECTORS + 0.5).astype(int) % SECTORS
    return at_border(points, size) & (direction == np.arange(SECTORS)[:, None])


def motion(first: Array, now: Array, sectors: Flags, agreed: float) -> tuple[Array, float] | None:
    """The camera's motion between points at first and now (P, 2) px: a homography (3, 3) back, and how far it took them.

    None where the border does not tell.
    """
    told = sectors & np.isfinite(now[:, 0])
    band, count = told.any(axis=0), told.sum(axis=1)
    if (count >= FEWEST).sum() < AGREEING:
        return None
    way = np.linalg.norm(now - first, axis=1)
    if np.median(way[band]) < STILL_PX:
        return np.eye(3), 0.0
    H, inlier = cv2.findHomography(now[band], first[band], cv2.RANSAC, OFF_PX, maxIters=TRIALS)
    if H is None or inlier.mean() < agreed:
        return None
    of_it = np.zeros(len(first), np.bool_)
    of_it[band] = inlier[:, 0] > 0
    if ((told & of_it).sum(axis=1) >= np.maximum(0.5 * count, FEWEST)).sum() < AGREEING:
        return None
    return np.asarray(H), float(np.median(way[of_it]))


def undone(now: Array, H: Array) -> Array:
    """Points (P, 2) px, NaN where not seen, that a homography (3, 3) takes back."""
    back, seen = np.full_like(now, np.nan), np.isfinite(now[:, 0])
    back[seen] = cv2.perspectiveTransform(now[seen][None], H)[0]
    return back
