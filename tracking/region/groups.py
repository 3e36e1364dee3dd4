"""Which points move together: groups between which the image's motion tears."""

from dataclasses import dataclass

import cv2
import numpy as np

from tracking import Array, Flags, Indices
from tracking.consistency import nearest_neighbours

NEIGHBOURS = 12  # of a point: enough on its own side of a border between two bodies
STIFFNESS = 0.05  # pull of local maps towards a shift, in units of the neighbours' mean square distance
ROUNDS = 4  # of re-weighting, so that neighbours on another body do not count
NOISE_PX = 0.5  # of a point's motion against its neighbours'
TORN_PX, TORN_SHARE = 1.5, 0.15  # or what is usual, and of how far the nearer end went: farther off, an edge may be torn
NOISE_SHARE = 1 / 3  # of that
TORN_OF = 0.75  # of how far its ends moved apart: what bends or stretches carries on, what tears jumps
FAR = 0.12  # of the picture's larger side: longer edges join nothing
CORE = 0.7  # of its edges that hold, or a point joins nothing: it may slide along a border
STAYS_PX, STAYS = 2.0, 0.25  # a point that goes no farther, nor so much of the way that the farthest tenth goes, stays
TENTH = 0.9  # the points that go farther than so many say how far things go: the very farthest may be lost ones
BETWEEN = 0.5  # times as many points as stay may go up to twice as far as those
SEED = 5  # points of a part that may be joined to another ...
SEAM, SEAM_HOLDS = 5, 0.5  # ... by so many edges, of which so many are not torn
FEWEST = 15  # points of a group
OFTEN = 0.5  # of the frames in which a point is seen, or nothing is said of it


@dataclass(frozen=True)
class Groups:
    """Points that move together.

    Attributes:
        label: (P,) number of a point's group, -1 for none.
        motion_px: (G,) median of how far the points of each group went from where they began.
    """

    label: Indices
    motion_px: Array

    @property
    def sizes(self) -> Indices:
        """(G,) points of each group."""
        return np.bincount(self.label[self.label >= 0], minlength=len(self.motion_px)).astype(np.int64)


def groups_of(W: Array, extent_px: float) -> Groups:
    """Groups of points by their tracks, largest first.

    Edges of the Delaunay mesh hold where one end goes where the other's surroundings carry it. Parts that hang together by
    them are joined where most of the seam between them is not torn: a sheet that waves moves otherwise here than there, but
    nowhere by jumps. Nor is there a jump where it is held, by something that stays: that is parted from it.

    Args:
        W: (F, P, 2) px, NaN where not seen; all are seen in the first frame.
        extent_px: larger side of the picture.
    """
    P = W.shape[1]
    label = np.full(P, -1)
    often = seen_often(W)
    if often.sum() < FEWEST:
        return Groups(label, np.zeros(0))
    W = W[:, often]
    moved = W - W[0]
    way = farthest(moved)
    edges = edges_beside(W[0], extent_px)
    by_end, apart = tear_px(W[0], moved, edges)
    tear = by_end.min(axis=0)
    torn = max(TORN_PX, float(np.median(tear)))  # in blurred pictures points go this way and that
    whole = by_end < TORN_OF * (apart + NOISE_SHARE * torn)
    parts = firm_parts(edges, tear < torn + TORN_SHARE * way[edges].min(axis=1), len(way))
    parts = joined(absorbed(parts, edges, whole), edges, np.asarray(whole.any(axis=0)))
    label[often], motion = numbered(parted(parts, way), way)
    return Groups(label, motion)


def seen_often(W: Array) -> Flags:
    """Which points (P,) of tracks (F, P, 2) are seen in enough frames."""
    return np.asarray(np.isfinite(W[:, :, 0]).mean(axis=0) >= OFTEN)


def farthest(moved: Array) -> Array:
    """How far points went from where they began, (P,) px, by their motions (F, P, 2); some frame must show each."""
    return np.asarray(np.nanmax(np.linalg.norm(moved, axis=2), axis=0))


def tear_px(place: Array, moved: Array, edges: Indices) -> tuple[Array, Array]:
    """How far ends of edges are from where the surroundings of the other ends carry them, and how far both move apart.

    The former (2, n) px by the surroundings of the first ends and of the second, the latter (n,) px; the most
    of all frames.

    Args:
        place: (P, 2) px.
        moved: (F, P, 2) since then, NaN where not seen.
        edges: (n, 2).
    """
    slope = local_slope(place, moved)
    i, j = edges.T
    gap, gain = place[j] - place[i], moved[:, j] - moved[:, i]
    off = [most(np.linalg.norm(gain - np.einsum("fncd,nd->fnc", slope[:, k], gap), axis=2)) for k in (i, j)]
    return np.stack(off), most(np.linalg.norm(gain, axis=2))


def most(values: Array) -> Array:
    """Largest (n,) of values (F, n) over frames; infinite where all are NaN."""
    known = np.isfinite(values)
    return np.where(known.any(axis=0), np.where(known, values, -np.inf).max(axis=0), np.inf)


def local_slope(place: Array, moved: Array) -> Array:
    """How motion changes along x and y around each point, (F, P, 2, 2), by those neighbours that always move like it."""
    beside = nearest_neighbours(place, NEIGHBOURS)
    apart = place[beside] - place[:, None]  # (P, k, 2)
    gain = moved[:, beside] - moved[:, :, None]  # (F, P, k, 2)
    known = np.isfinite(gain[..., 0])
    gain = np.where(known[..., None], gain, 0.0)
    products = (apart[..., :, None] * apart[..., None, :]).reshape(*beside.shape, 4)
    pull = STIFFNESS * (apart**2).sum(axis=(1, 2))[:, None, None] * np.eye(2)
    slope = np.zeros((*moved.shape, 2))
    for _ in range(ROUNDS):
        left = gain - apart @ slope.swapaxes(2, 3)
        off = np.sqrt((left**2).sum(axis=(0, 3)) / known.sum(axis=0).clip(1))  # (P, k)
        usual = np.median(off, axis=1, keepdims=True) + NOISE_PX
        w = known / (1.0 + (2.0 * off / usual) ** 2) ** 2
        gram = (w[..., None, :] @ products).reshape(slope.shape) + pull
        slope = (w[..., None] * gain).swapaxes(2, 3) @ apart @ np.linalg.inv(gram)
    return np.asarray(slope)


def edges_beside(place: Array, extent_px: float) -> Indices:
    """Edges (n, 2) of the Delaunay mesh of points (P, 2), short enough to join them in a picture of that larger side."""
    edges = delaunay_edges(place)
    return edges[np.linalg.norm(place[edges[:, 0]] - place[edges[:, 1]], axis=1) < FAR * extent_px]


def delaunay_edges(place: Array) -> Indices:
    """Edges (n, 2) of the Delaunay mesh of points (P, 2)."""
    low, high = np.floor(place.min(axis=0)).astype(int) - 1, np.ceil(place.max(axis=0)).astype(int) + 1
    mesh = cv2.Subdiv2D((int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])))
    points = place.astype(np.float32)
    mesh.insert(points.tolist())
    number = {(x, y): i for i, (x, y) in enumerate(points.tolist())}
    ends = [(number.get((a, b), -1), number.get((c, d), -1)) for a, b, c, d in np.asarray(mesh.getEdgeList()).tolist()]
    pairs = np.sort(np.array(ends, np.int64), axis=1)
    return np.unique(pairs[(pairs[:, 0] >= 0) & (pairs[:, 0] != pairs[:, 1])], axis=0)  # others lead to the frame around it


def connected(edges: Indices, count: int) -> Indices:
    """The least number (count,) of the nodes that each is connected to by edges (n, 2)."""
    label = np.arange(count)
    while True:
        least = label.copy()
        for a, b in (edges.T, edges.T[::-1]):
            np.minimum.at(least, a, label[b])
        least = least[least]
        if (least == label).all():
            return label
        label = least


def firm_parts(edges: Indices, holds: Flags, count: int) -> Indices:
    """What hangs together by edges (n, 2) that hold (n,): the part (count,) of each point, -1 for none."""
    all_ends, held = (np.bincount(chosen.ravel(), minlength=count) for chosen in (edges, edges[holds]))
    core = held >= np.maximum(CORE * all_ends, 1)
    firm = edges[holds & core[edges].all(axis=1)]
    return np.where(core, connected(firm, count), -1)


def absorbed(part: Indices, edges: Indices, whole: Flags) -> Indices:
    """Parts (P,), points without one (-1) added to where most of their edges (n, 2) lead to, if those are whole (2, n).

    By the surroundings of the other end, that is: those of a point beside all others explain anything.
    """
    part, ends = part.copy(), np.concatenate([edges, edges[:, ::-1]])
    whole = np.concatenate([whole[1], whole[0]])
    while True:
        out = (part[ends[:, 0]] < 0) & (part[ends[:, 1]] >= 0)
        pairs, which = np.unique(np.stack([ends[out, 0], part[ends[out, 1]]], axis=1), axis=0, return_inverse=True)
        count, holds = (np.bincount(which, weights, len(pairs)) for weights in (None, whole[out]))
        sure = holds > 0.5 * np.bincount(pairs[:, 0], count, len(part))[pairs[:, 0]]  # of all its edges: one part at most
        if not sure.any():
            return part
        part[pairs[sure, 0]] = pairs[sure, 1]


def joined(part: Indices, edges: Indices, whole: Flags) -> Indices:
    """Parts (P,), those joined between which most edges are whole (n,), the surest seam first."""
    part = part.copy()
    size = np.bincount(part[part >= 0], minlength=len(part))
    while True:
        a, b = np.sort(part[edges], axis=1).T
        seam = (a >= 0) & (a != b)
        seam[seam] = np.minimum(size[a[seam]], size[b[seam]]) >= SEED
        pairs, which = np.unique(np.stack([a, b], axis=1)[seam], axis=0, return_inverse=True)
        if not len(pairs):
            return part
        count = np.bincount(which, minlength=len(pairs))
        share = np.bincount(which, whole[seam], len(pairs)) / count
        share[count < SEAM] = 0.0
        k = int(share.argmax())
        if share[k] < SEAM_HOLDS:
            return part
        part[part == pairs[k, 1]] = pairs[k, 0]
        size = np.bincount(part[part >= 0], minlength=len(part))


def parted(part: Indices, way: Array) -> Indices:
    """Parts (P,), those in which many points stay and many move parted by that, by the way (P,) each point went.

    Few may go a little farther than what stays: on a sheet that turns as many do, beside its axis.
    """
    part = part.copy()
    for one in np.unique(part[part >= 0]):
        own = part == one
        least = min(STAYS_PX, STAYS * float(np.quantile(way[own], TENTH)))
        stays, moves = own & (way < least), own & (way >= least)
        between = moves & (way < 2 * least)
        if min(stays.sum(), moves.sum()) >= FEWEST and between.sum() < BETWEEN * stays.sum():
            part[stays] = part.max() + 1
    return part


def numbered(part: Indices, way: Array) -> tuple[Indices, Array]:
    """Parts (P,) as groups numbered by size, those too small left out; and the median way (G,) of each."""
    size = np.bincount(part[part >= 0], minlength=1)
    order = np.argsort(-size, kind="stable")
    order = order[size[order] >= FEWEST]
    rank = np.full(len(size), -1)
    rank[order] = np.arange(len(order))
    label = np.where(part >= 0, rank[part], -1)
    return label, np.array([np.median(way[label == k]) for k in range(len(order))])
