"""Local consistency: a surface moves its points like their neighbours, by a locally affine map."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

NEIGHBOURS = 10  # of which a third may be wrong and six numbers are still well determined
STIFFNESS = 0.02  # pull towards the prior map, in units of the neighbours' mean square distance
MIN_SUPPORT = 3.0  # trusted neighbours below which nothing can be said about a point
ROUNDS = 5  # of re-weighting; 4 miss 2 % of the outliers where these are 30 % of the points, 5 miss 0.3 %
SETTLED = 0.02  # change of all weights below which no further round is needed
NOISE_PX = 0.5  # least scale of disagreement: tracking noise and curvature between neighbours
CHAOS = 0.1  # greatest scale, in neighbour distances: where all points disagree, none is excused by the others
OUTLIER = 4.0  # scales from the neighbours' prediction


@dataclass(frozen=True)
class LocalMotion:
    """How each point's surroundings moved since the reference frame.

    Attributes:
        affine: (P, 2, 2) linear part of the local map.
        fitted_px: (P, 2) where the neighbours say the point is, without asking the point itself.
        support: (P,) sum of the neighbours' weights.
        consistent: (P,) whether the point is where its neighbours say, or nothing can be said.
    """

    affine: Array
    fitted_px: Array
    support: Array
    consistent: Flags


def nearest_neighbours(points_px: Array, count: int = NEIGHBOURS) -> Indices:
    """Indices (P, k) of each point's k nearest others, k = min(count, P - 1), nearest first."""
    k = min(count, len(points_px) - 1)
    rows = []
    for start in range(0, len(points_px), 512):  # in blocks: P² distances need not be in memory at once
        block = points_px[start : start + 512]
        distance = np.sum((block[:, None] - points_px[None]) ** 2, axis=-1)
        distance[np.arange(len(block)), np.arange(start, start + len(block))] = -1.0
        nearest = np.argpartition(distance, k, axis=1)[:, : k + 1]
        order = np.argsort(np.take_along_axis(distance, nearest, axis=1), axis=1)
        rows.append(np.take_along_axis(nearest, order, axis=1)[:, 1:])
    return np.concatenate(rows).astype(np.int64)


def local_motion(reference_px: Array, current_px: Array, weight: Array, neighbours: Indices, prior: Array) -> LocalMotion:
    """Robust local affine maps from the reference to now; points that disagree lose their say.

    Args:
        reference_px: (P, 2) points in the reference frame.
        current_px: (P, 2) the same now; NaN where unknown.
        weight: (P,) confidence in `current_px`, 0 where unknown.
        neighbours: (P, k) of `nearest_neighbours`.
        prior: (P, 2, 2) maps to fall back on where neighbours are few or in line.
    """
    known = np.where(weight[:, None] > 0, current_px, 0.0)
    # By what is known, not by what is trusted: else a gross outlier that upsets its neighbours is excused.
    support = weight[neighbours].sum(axis=1)
    judged = (weight > 0) & (support >= MIN_SUPPORT)
    limit = CHAOS * _reach(reference_px, neighbours)
    trust = weight
    for _ in range(ROUNDS):
        affine, fitted = _fit(reference_px, known, trust, neighbours, prior)
        residual = np.linalg.norm(known - fitted, axis=1)
        scale = NOISE_PX
        if judged.any():
            scale = max(scale, min(1.4826 * float(np.median(residual[judged])), limit))
        before, trust = trust, np.where(judged, weight / (1.0 + (residual / (2.0 * scale)) ** 2), weight)
        if np.abs(trust - before).max(initial=0.0) < SETTLED:
            break
    return LocalMotion(affine, fitted, support, ~judged | (residual < OUTLIER * scale))


def _reach(reference: Array, neighbours: Indices) -> float:
    """Median distance of the farthest neighbour."""
    distance = np.linalg.norm(reference[neighbours] - reference[:, None], axis=2)
    return float(np.median(distance.max(axis=1, initial=0.0)))


def _fit(reference: Array, current: Array, weight: Array, neighbours: Indices, prior: Array) -> tuple[Array, Array]:
    """Weighted least squares of each neighbourhood about its centroid: maps and predictions."""
    w = weight[neighbours]
    w /= np.maximum(w.sum(axis=1), 1e-9)[:, None]
    # By coordinate, not by 2x2 matrices: stacks of tiny products cost NumPy several times as much.
    coordinates = [column[neighbours] for column in (*reference.T, *current.T)]
    means = [_rows(w, c) for c in coordinates]
    x, y, u, v = (c - mean[:, None] for c, mean in zip(coordinates, means, strict=True))
    wx, wy = w * x, w * y
    xx, xy, yy = _rows(wx, x), _rows(wx, y), _rows(wy, y)
    pull = STIFFNESS * (xx + yy) + 1e-6
    xx, yy = xx + pull, yy + pull
    determinant = xx * yy - xy * xy
    affine = np.empty_like(prior)
    for row, moved in enumerate((u, v)):
        mx = _rows(wx, moved) + pull * prior[:, row, 0]
        my = _rows(wy, moved) + pull * prior[:, row, 1]
        affine[:, row, 0] = (mx * yy - my * xy) / determinant
        affine[:, row, 1] = (my * xx - mx * xy) / determinant
    offset = reference - np.stack(means[:2], axis=1)
    return affine, np.stack(means[2:], axis=1) + np.einsum("nij,nj->ni", affine, offset)


def _rows(a: Array, b: Array) -> Array:
    product: Array = np.einsum("ij,ij->i", a, b)
    return product
