"""The surface among groups of points: the one that moves most, and where it is in the picture."""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from tracking import Array, Flags, Floats, Image, Indices
from tracking.consistency import spacing_px
from tracking.region.background import STILL_PX, at_border
from tracking.region.groups import FEWEST, connected, edges_beside, groups_of

OUTSIDE = 0.35  # of its points are at the picture's border: it is behind what is not
FOLLOWS = 0.25  # of the way that those beside it go, a point that goes with them may be off
BESIDE = 8  # points of the surface that say where a point beside them should go
STRAY_PX = 3.0  # a point no farther from where the surface would carry it is not of something else, and ...
SHARED = 0.5  # ... one that goes so much of its way: a lip or a chin goes farther, what is behind stays
REACH = 1.0  # times the usual distance between points on it, that the surface goes on beyond them
GAP = 2.0  # the same: narrower gaps between its parts are its own
FAR_ENOUGH = 0.05  # of the picture's larger side: what has moved so far in a region that was drawn has moved
HOLE = 15  # points of something else in a hole of the surface: with fewer, it is none
LEFT = 30  # points beside each other that leave what is behind are enough to say where the surface is
OTHER_SHARE = 0.1  # of the best group's score: less, and a group is not worth a word


@dataclass(frozen=True)
class Surface:
    """A surface that moves.

    Attributes:
        mask: (H, W) uint8, 255 where it is.
        own: (P,) points on it.
        other: (P,) points of something else.
    """

    mask: Image
    own: Flags
    other: Flags

    @property
    def box(self) -> tuple[int, int, int, int]:
        """x, y, width, height of the rectangle around it, px."""
        x, y, w, h = cv2.boundingRect(self.mask)
        return int(x), int(y), int(w), int(h)


def surfaces(W: Array, region: Image, still_px: float = STILL_PX) -> list[Surface]:
    """What moves in a region, the one with most points times motion first, those not worth a word left out.

    A region that was drawn was drawn around the surface: points in its middle count most, those on its border nothing.

    Args:
        W: (F, P, 2) px, tracks of points of the region; NaN where not seen.
        region: (H, W) uint8, 255 inside.
        still_px: what moves less does not move.
    """
    found, side = groups_of(W, float(max(region.shape))), max(region.shape)
    weight = middling(W[0], region)[found.label >= 0]
    size = np.bincount(found.label[found.label >= 0], weight, len(found.motion_px))
    way = found.motion_px if region.all() else found.motion_px.clip(max=FAR_ENOUGH * side)
    score = np.where(found.motion_px > still_px, size * way, 0.0)
    order = [int(k) for k in np.argsort(-score, kind="stable") if score[k] > OTHER_SHARE * score.max()]
    groups, still = [found.label == k for k in order], np.isin(found.label, np.flatnonzero(found.motion_px <= still_px))
    if region.all():  # one that was drawn may be all the surface
        groups = in_front(W, groups, still, region)
    grouped = np.any([found.label >= 0, *groups], axis=0)
    return [surface_of(W, group, grouped, region) for group in groups]


def in_front(W: Array, groups: list[Flags], still: Flags, region: Image) -> list[Flags]:
    """Groups (P,) of a whole picture, the best first, as in front of what is behind: what is still (P,), or at the border.

    Those at the border come last. What leaves what is behind is the first, if the first is a small part of that, or none.
    """
    border = at_border(W[0], np.array(region.shape[::-1]))
    outside = [group for group in groups if border[group].mean() > OUTSIDE]
    inside = [group for group in groups if border[group].mean() <= OUTSIDE]
    behind, least = np.any([still, *outside], axis=0), 2 * int(inside[0].sum()) if inside else FEWEST
    loose = left_by(W, behind, max(region.shape), least)
    holds_it = not inside or (inside[0] & loose).sum() > 0.5 * inside[0].sum()
    if loose.sum() >= least and holds_it and (not outside or border[loose].mean() <= OUTSIDE):
        inside = [loose, *(group for group in inside if not (group & loose).any())]
    return inside + outside


def left_by(W: Array, behind: Flags, side: int, least: int) -> Flags:
    """Most points (P,) beside each other that do not go where others (P,) would carry them; none, if fewer than least go.

    Where hardly anything but what is behind has a group, what goes its own way is the surface: small, or lost again and
    again. In the first frames that tell: later it covers points that were behind, and takes them along.
    """
    own = np.zeros_like(behind)
    if not behind.any() or leaving(W, behind).sum() < least:
        return own
    edges = edges_beside(W[0], side)
    for frames in range(2, len(W) + 1):
        loose = leaving(W[:frames], behind)
        part = np.where(loose, connected(edges[loose[edges].all(axis=1)], len(loose)), -1)
        size = np.bincount(part[loose], minlength=1)
        if size.max() >= max(FEWEST, own.sum() + 1):
            own = np.asarray(part == size.argmax())
        if own.sum() >= LEFT:
            return with_those_that_follow(W, own, ~behind, edges)
    return own


def leaving(W: Array, behind: Flags) -> Flags:
    """Which points (P,) go, but not where others (P,) would carry them."""
    off, _, way = astray_px(W, behind)
    return np.asarray(~behind & (off > STRAY_PX) & (way > STILL_PX))


def with_those_that_follow(W: Array, own: Flags, others: Flags, edges: Indices) -> Flags:
    """Points (P,) and of others (P,) those beside them, by edges (n, 2), that go as they do in all frames W (F, P, 2)."""
    while True:
        off, carried, way = astray_px(W, own)
        follows = others & ~own & (way > STRAY_PX) & (off < np.maximum(STRAY_PX, FOLLOWS * carried))
        beside = np.zeros_like(own)
        beside[edges[own[edges].any(axis=1)]] = True
        if not (follows & beside).any():
            return own
        own = own | (follows & beside)


def middling(place: Array, region: Image) -> Array:
    """How near points (P, 2) px are to the middle of a region, 1 there and 0 at its border, (P,); 1 in a whole picture."""
    if region.all():
        return np.ones(len(place))
    x, y, w, h = cv2.boundingRect(region)
    off = np.abs(2 * (place - (x, y) + 0.5) / (w, h) - 1)
    return np.asarray(1 - off.max(axis=1)).clip(0)


def surface_of(W: Array, group: Flags, grouped: Flags, region: Image) -> Surface:
    """The surface that a group (P,) of points is on; `grouped` (P,) are in this or another one."""
    off, carried, way = astray_px(W, group)
    own = group & (way > SHARED * carried)  # else it was not seen when the others moved
    other = ~group & (grouped | ((off > STRAY_PX) & (way < SHARED * carried)))
    doubtful = ~own & ~other & ~region.all()  # in a region that somebody chose, points that were lost are as good ...
    if (grouped & ~group).sum() > BESIDE:
        doubtful &= off <= np.maximum(astray_px(W, grouped & ~group)[0], STRAY_PX)  # ... unless they went as the others
    return Surface(surface_mask(W[0], own | doubtful, other, region), own, other)


def astray_px(W: Array, own: Flags) -> tuple[Array, Array, Array]:
    """How far points are from where a surface would carry them, how far it would, and how far they go, (P,) px each.

    The most of all frames; of those that show a point, but for where it would be carried.

    It carries them as its points go, by one affine map a frame, and by what that leaves over at those beside them.

    Args:
        W: (F, P, 2) px, NaN where not seen.
        own: (P,) points of the surface; they do not count for themselves.
    """
    index = np.flatnonzero(own)
    distance = ((W[0][:, None] - W[0][index]) ** 2).sum(axis=2)
    beside = index[np.argsort(distance, axis=1)[:, : BESIDE + 1]]
    moved, first = W - W[0], np.column_stack([np.ones(W.shape[1]), W[0] - W[0][index].mean(axis=0)])
    seen = np.isfinite(moved[:, :, 0])
    h = (seen & own).astype(np.float64)
    known = np.where(seen[:, :, None], moved, 0.0)
    gram = np.einsum("fp,pc,pd->fcd", h, first, first) + 1e-6 * np.eye(3)
    affine = first @ np.linalg.solve(gram, np.einsum("fp,pc,fpd->fcd", h, first, known))
    counts = h[:, beside] * (beside != np.arange(W.shape[1])[:, None])
    left = np.einsum("fpk,fpkc->fpc", counts, (known - affine)[:, beside]) / counts.sum(axis=2).clip(1)[:, :, None]
    carried = affine + left
    off = np.where(seen, np.linalg.norm(known - carried, axis=2), 0.0)
    return off.max(axis=0), np.linalg.norm(carried, axis=2).max(axis=0), np.linalg.norm(known, axis=2).max(axis=0)


def surface_mask(place: Array, own: Flags, others: Flags, region: Image) -> Image:
    """Where a surface is, (H, W) uint8: nearer to its points than to others, and not far from them; without small holes.

    Args:
        place: (P, 2) px.
        own: (P,) points of the surface.
        others: (P,) points that are not.
        region: (H, W) uint8, 255 where it may be.
    """
    spacing = spacing_px(place[own])
    to_own, to_other = (distance_to(place[which], region.shape[:2]) for which in (own, others))
    nearer = np.asarray(to_own <= to_other, np.uint8)
    near = nearer * (to_own < REACH * spacing)
    whole = (1 - grown(1 - grown(near, GAP * spacing), GAP * spacing)) * nearer
    smooth = grown(1 - grown(1 - whole, REACH * spacing), REACH * spacing)
    smooth = smooth if smooth.any() else near  # points too far apart for anything smooth
    contours, levels = cv2.findContours(smooth, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    mask = np.zeros(region.shape[:2], np.uint8)
    cv2.drawContours(
        mask, [c for c, level in zip(contours, levels[0], strict=True) if level[3] < 0], -1, (255,), cv2.FILLED
    )
    x, y = np.rint(place[others]).astype(int).T.clip(0, np.array(mask.shape[::-1])[:, None] - 1)  # may be at the border
    for contour, level in zip(contours, levels[0], strict=True):
        hole = np.zeros_like(mask)
        if (
            level[3] >= 0
            and len(cv2.drawContours(hole, [contour], -1, (255,), cv2.FILLED))
            and np.count_nonzero(hole[y, x]) >= HOLE
        ):
            mask[(hole > 0) & (smooth == 0)] = 0
    return cast(Image, mask & region)


def grown(mask: Image, radius_px: float) -> Image:
    """What is no farther than so much from a mask (H, W) of 0 and 1: takes the same time however far that is."""
    return np.asarray(distance_from(mask > 0) <= np.ceil(radius_px), np.uint8)


def distance_to(points: Array, shape: tuple[int, int]) -> Floats:
    """Distance (H, W) px of each pixel from the nearest of some points (n, 2); infinite if there are none."""
    at = np.zeros(shape, np.bool_)
    x, y = np.rint(points).astype(int).T
    at[y.clip(0, shape[0] - 1), x.clip(0, shape[1] - 1)] = True
    return distance_from(at)


def distance_from(part: Flags) -> Floats:
    """Distance (H, W) px of each pixel from the nearest in a part (H, W) of the picture; infinite if that is empty."""
    if not part.any():
        return np.full(part.shape, np.inf, np.float32)
    return cast(Floats, cv2.distanceTransform((~part).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE))
