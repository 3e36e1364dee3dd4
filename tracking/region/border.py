"""The border of a surface in a picture: not half-way between its points and others, but where its colours end."""

import cv2
import numpy as np

from tracking import Array, Flags, Floats, Image
from tracking.consistency import spacing_px
from tracking.flow import WINDOW_PX
from tracking.region.surface import distance_from, distance_to

SIDE_PX = 240  # the larger side of the picture that is cut: time grows with its area
COLOURS = 5  # that GrabCut tells on each side: so many pixels at least must be known to be there
STEPS = 2  # of colours learned and the picture cut
DENSE = 1.0  # times the usual distance between points on it, around each: what is then apart from most of it is doubtful
OUTSIDE, INSIDE = 1.0, 1.3  # the same, that the border may be from the rough one
INSET_PX, INSET_SHARE = WINDOW_PX // 2, 0.035  # a window sees so far; but no more than this of a small surface's side
KEPT = 0.87  # of the surface's points: if fewer are left, its colours are those of what is around it


def at_colours(mask: Image, image_bgr: Image, points_px: Array) -> Image:
    """The surface (H, W) uint8 with its border where the colours say, by GrabCut (Rother et al., SIGGRAPH 2004).

    Args:
        mask: (H, W) uint8, 255 where it is by the motion of its points.
        image_bgr: (H, W, 3) uint8, the picture.
        points_px: (n, 2) points on it.

    Returns:
        The mask as it was where the colours on both sides are alike.
    """
    scale = min(1.0, SIDE_PX / max(mask.shape))
    small = cv2.resize(image_bgr, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    rough = cv2.resize(mask, small.shape[1::-1], interpolation=cv2.INTER_AREA) > 127
    spacing, places = spacing_px(points_px) * scale, scale * (points_px + 0.5)
    inside, outside = (within(part) / spacing for part in (rough, ~rough))
    main = fullest((distance_to(places - 0.5, rough.shape) < DENSE * spacing).astype(np.uint8), places - 0.5)
    labels = np.where(rough, cv2.GC_PR_FGD, cv2.GC_PR_BGD).astype(np.uint8)
    labels[main & (inside > INSIDE)] = cv2.GC_FGD
    labels[outside > OUTSIDE] = cv2.GC_BGD
    if min(np.count_nonzero(labels == sure) for sure in (cv2.GC_FGD, cv2.GC_BGD)) < COLOURS:
        return mask
    cv2.setRNGSeed(0)
    learned, whole = (np.zeros((1, 13 * COLOURS)), np.zeros((1, 13 * COLOURS))), (0, 0, *small.shape[1::-1])
    cv2.grabCut(small, labels, whole, *learned, STEPS, cv2.GC_INIT_WITH_MASK)
    cut = np.where((labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD), 255, 0).astype(np.uint8)
    x, y = np.floor(places).astype(int).T
    sure = cv2.erode(cut, np.ones((3, 3), np.uint8), borderValue=255)  # a pixel at the border is of both sides
    if np.mean(cut[y.clip(0, len(cut) - 1), x.clip(0, cut.shape[1] - 1)] > 0) < KEPT or not sure.any():
        return mask
    return np.where(cv2.resize(sure, mask.shape[::-1], interpolation=cv2.INTER_LINEAR) > 127, 255, 0).astype(np.uint8)


def inset(mask: Image, region: Image) -> Image:
    """A mask (H, W) uint8 without what is so near to the rest of its region (H, W) that windows there see beyond it.

    Its outline is the strongest edge there is, and what is on it slides along.
    """
    from_rest = distance_from((region > 0) & (mask == 0))
    limit = min(INSET_PX, INSET_SHARE * float(np.sqrt(np.count_nonzero(mask))))
    return np.where((mask > 0) & (from_rest > limit), 255, 0).astype(np.uint8)


def fullest(mask: Image, points: Array) -> Flags:
    """The part (H, W) of a mask (H, W) of 0 and 1 that holds most of some points (n, 2) px in it."""
    part = cv2.connectedComponents(mask)[1]
    x, y = np.rint(points).astype(int).T
    return np.asarray(part == np.bincount(part[y.clip(0, len(part) - 1), x.clip(0, part.shape[1] - 1)]).argmax())


def within(part: Flags) -> Floats:
    """How far (H, W) px each pixel of a part (H, W) is from what is not in it; beyond the picture nothing is."""
    return distance_from(~np.pad(part, 1))[1:-1, 1:-1]
