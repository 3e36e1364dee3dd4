"""How alike the views of keyframes are: the similarity between each two, and in which order to build on them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.camera import nearest_rotation
from reconstruction.mapping.outliers import medians

COMPARED = 120  # points: enough to tell views apart
ROUNDS = 4  # of robust weights
FEWEST_SHARED = 3  # points, ...
ENOUGH_SHARED = 10  # ... and so many, or a third of what either shows: few agree by chance, those of front and back
HIDDEN, ALL_AROUND = 0.005, 8  # share of pairs of views that share too few points; from there on so many may be first
BESIDE = 7  # views next to the first from which a point's place in it is taken


@dataclass(frozen=True)
class Likeness:
    """Similarities between all pairs of K views: z_j ≈ a_ij z_i + b_ij, points as complex numbers x + iy.

    Attributes:
        a, b: (K, K) complex; 1 and NaN for views that share too few points.
        distance: (K, K) what is left, robustly, in units of image j; of those more than of all others.
    """

    a: NDArray[np.complex128]
    b: NDArray[np.complex128]
    distance: Array


def likeness(W: Array, visible: Mask) -> Likeness:
    """Compare all pairs of views (K, 2, p); robust against outliers and missing points."""
    place = np.where(visible[:, None], W, 0.0).sum(axis=0) / visible.sum(axis=0).clip(1)
    few = farthest_points(place.T, COMPARED)
    z = np.where(visible, W[:, 0] + 1j * W[:, 1], 0.0)[:, few]
    both = (visible[:, None] & visible)[:, :, few]
    zi, zj = np.broadcast_arrays(z[:, None], z[None])
    w = both.astype(np.float64)
    for _ in range(ROUNDS):
        total = w.sum(axis=2).clip(1e-12)
        mean_i, mean_j = (w * zi).sum(axis=2) / total, (w * zj).sum(axis=2) / total
        ci, cj = zi - mean_i[:, :, None], zj - mean_j[:, :, None]
        size = (w * np.abs(ci) ** 2).sum(axis=2)
        a = (w * ci.conj() * cj).sum(axis=2) / size.clip(1e-300)
        off = np.abs(cj - a[:, :, None] * ci)
        middle = np.nan_to_num(medians(np.where(both, off, np.nan), axis=2))
        w = both / (1 + (off / (2 * middle + 1e-12)[:, :, None]) ** 2) ** 2
    shared = both.sum(axis=2)
    shown = np.diag(shared)
    known = shared >= np.clip(np.minimum(shown[:, None], shown) / 3, FEWEST_SHARED, ENOUGH_SHARED)
    known &= size > 0
    b = np.where(known, mean_j - a * mean_i, np.nan)
    return Likeness(np.where(known, a, 1.0), b, np.where(known, middle, 1e6 * (middle[known].max(initial=0.0) + 1e-300)))


def first_views(alike: Likeness, visible: Mask) -> list[int]:
    """Views to build on from: the one in the middle; where a solid hides its far side, others all around it, too.

    From a view that shows one flat side, or two that look alike, the other sides may never be found.

    Args:
        alike: how alike the views are.
        visible: (K, p).
    """
    count = visible.sum(axis=1)
    telling = count >= np.median(count) / 2  # a few points agree by chance
    apart = np.median(alike.distance + alike.distance.T, axis=1)
    middle = int(np.where(telling, apart, np.inf).argmin())
    if np.isnan(alike.b.real).mean() < HIDDEN:
        return [middle]
    order = building_order(alike, middle)[0][1:]
    order = order[count[order] >= np.median(count)]
    return [middle, *(int(order[k]) for k in np.unique(np.linspace(0, len(order) - 1, ALL_AROUND - 1).astype(int)))]


def building_order(alike: Likeness, first: int) -> tuple[Indices, Indices]:
    """Views (K,): the first, then always the nearest to those before; and (K,) which of those that is."""
    K = len(alike.distance)
    apart = alike.distance + alike.distance.T
    order, parent = [first], [first]
    nearest, by = apart[first].copy(), np.full(K, first)
    for _ in range(K - 1):
        nearest[order] = np.inf
        new = int(nearest.argmin())
        order.append(new)
        parent.append(int(by[new]))
        closer = apart[new] < nearest
        nearest[closer], by[closer] = apart[new][closer], new
    return np.array(order), np.array(parent)


def completed(W: Array, visible: Mask, alike: Likeness, view: int) -> Array:
    """All points (2, p) as one view should see them: the middle of where the views like it put them."""
    z = (np.where(visible, W[:, 0] + 1j * W[:, 1], np.nan) - alike.b[view][:, None]) / alike.a[view][:, None]
    beside = np.argsort(alike.distance[view])
    near, far = (complex_medians(z[beside[:count]]) for count in (BESIDE, len(z)))
    best = np.where(np.isfinite(near.real), near, far)
    best = np.where(np.isfinite(best.real), best, np.nanmean(best))
    return np.stack([best.real, best.imag])


def with_unseen(shape: Array, seen: Mask, known: Array | None) -> Array:
    """A shape (3, p), points that no view shows where a known one (3, p), laid on to it, has them; without in its middle.

    Args:
        shape: as above.
        seen: (p,) whether any view shows a point.
        known: of any size, turned anyhow.
    """
    whole, middle = shape.copy(), shape[:, seen].mean(axis=1, keepdims=True)
    whole[:, ~seen] = middle
    if known is not None and not seen.all():
        known = known - known[:, seen].mean(axis=1, keepdims=True)
        M = (shape - middle)[:, seen] @ known[:, seen].T
        R = nearest_rotation(M)
        whole[:, ~seen] += float((R * M).sum() / (known[:, seen] ** 2).sum()) * R @ known[:, ~seen]
    return whole


def complex_medians(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Medians (p,) of real and imaginary parts of (n, p), NaN where nothing is known."""
    known = np.isfinite(z.real)
    return medians(np.where(known, z.real, np.nan), axis=0) + 1j * medians(np.where(known, z.imag, np.nan), axis=0)
