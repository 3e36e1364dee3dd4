"""Local consistency: a surface moves its points like their neighbours, by a locally affine map."""

from dataclasses import dataclass

import numpy as np

from tracking import Array, Flags, Indices

NEIGHBOURS = 10  # of which a third may be wrong and six numbers are still well determined
SPACING = 3  # the neighbour whose distance is the usual one
STIFFNESS = 0.02  # pull towards the prior map, in units of the neighbours' mean square distance
MIN_SUPPORT = 3.0  # sum of the neighbours' weights; below, a point is not judged
ROUNDS = 5  # of re-weighting; 4 miss 2 % of the outliers where these are 30 % of the points, 5 miss 0.3 %
CONVERGED = 0.02  # change of all weights below which no further round is needed
NOISE_PX = 0.5  # least scale of the residuals: tracking noise and curvature between neighbours
GREATEST_SCALE = 0.1  # of the residuals, in neighbour distances: where all points disagree, all are outliers
OUTLIER = 4.0  # scales; a larger residual is an outlier


@dataclass(frozen=True)
class LocalMotion:
    """How each point's surroundings moved since the reference frame.

    Attributes:
        affine: (P, 2, 2) linear part of the local map.
        fitted_px: (P, 2) each point as its neighbours' map predicts it; the point itself is not among them.
        support: (P,) sum of the neighbours' weights.
        consistent: (P,) whether the point is near the prediction, or has too few neighbours for one.
        trust: (P,) robust weight of each point in the end.
        scale_px: robust scale of the residuals.
    """

    affine: Array
    fitted_px: Array
    support: Array
    consistent: Flags
    trust: Array
    scale_px: float


class Surroundings:
    """The neighbours of the points of a reference frame, and how they move together.

    Args:
        reference_px: (P, 2) points in the reference frame.

    Attributes:
        neighbours: (P, k) of `nearest_neighbours`.
    """

    def __init__(self, reference_px: Array) -> None:
        self.neighbours = nearest_neighbours(reference_px)
        self._reference = reference_px
        # Neighbours come first, points last: sums over neighbours then run along the points in memory.
        self._columns = np.ascontiguousarray(self.neighbours.T)
        x, y = (column[self._columns] - column for column in reference_px.T)
        self._offsets = np.stack([x, y, x * x, x * y, y * y], axis=1)
        self._limit = GREATEST_SCALE * float(np.median(np.hypot(x, y).max(axis=0, initial=0.0)))

    def motion(self, current_px: Array, weight: Array, prior: Array) -> LocalMotion:
        """Local affine maps from the reference to now, by iteratively re-weighted least squares.

        Args:
            current_px: (P, 2) the points now; NaN where unknown.
            weight: (P,) confidence in `current_px`, 0 where unknown.
            prior: (P, 2, 2) maps to fall back on where neighbours are few or in line.
        """
        moved = np.where(weight > 0, (current_px - self._reference).T, 0.0)
        products = self._products(moved, slice(None))
        # Counted in weights, not in trust: a gross outlier that lowers its neighbours' trust is still judged.
        support = weight[self._columns].sum(axis=0)
        judged = (weight > 0) & (support >= MIN_SUPPORT)
        trust = weight
        for _ in range(ROUNDS):
            affine, fitted = self._fit(products, trust, prior, slice(None))
            residual = np.hypot(*(moved - fitted))
            scale = NOISE_PX
            if judged.any():
                scale = max(scale, min(1.4826 * float(np.median(residual[judged])), self._limit))
            before, trust = trust, np.where(judged, weight / (1.0 + (residual / (2.0 * scale)) ** 2), weight)
            if np.abs(trust - before).max(initial=0.0) < CONVERGED:
                break
        consistent = ~judged | (residual < OUTLIER * scale)
        return LocalMotion(affine, self._reference + fitted.T, support, consistent, trust, scale)

    def agree(self, current_px: Array, which: Indices, motion: LocalMotion) -> Flags:
        """Whether points found since move like their neighbours, each other included: (n,); True for those not judged.

        Args:
            current_px: (P, 2) the points now, NaN where unknown.
            which: (n,) indices of those found since.
            motion: of the others.
        """
        known = np.isfinite(current_px[:, 0])
        moved = np.where(known, (current_px - self._reference).T, 0.0)
        trust = np.where(known, motion.trust, 0.0)
        trust[which] = 1.0
        products, prior = self._products(moved, which), motion.affine[which]
        judged = known[self._columns[:, which]].sum(axis=0) >= MIN_SUPPORT
        for _ in range(ROUNDS):
            _, fitted = self._fit(products, trust, prior, which)
            residual = np.hypot(*(moved[:, which] - fitted))
            before, now = trust[which], np.where(judged, 1.0 / (1.0 + (residual / (2.0 * motion.scale_px)) ** 2), 1.0)
            trust[which] = now
            if np.abs(now - before).max(initial=0.0) < CONVERGED:
                break
        return ~judged | (residual < OUTLIER * motion.scale_px)

    def _products(self, moved: Array, rows: slice | Indices) -> Array:
        """The terms that a fit sums up over neighbours: (k, 11, n), for displacements (2, P)."""
        columns, offsets = self._columns[:, rows], self._offsets[:, :, rows]
        u, v = moved[0][columns], moved[1][columns]
        x, y = offsets[:, 0], offsets[:, 1]
        return np.concatenate([offsets, np.stack([u, v, x * u, y * u, x * v, y * v], axis=1)], axis=1)

    def _fit(self, products: Array, trust: Array, prior: Array, rows: slice | Indices) -> tuple[Array, Array]:
        """Weighted least squares of each neighbourhood about its centroid: maps (n, 2, 2), displacements (2, n)."""
        w = trust[self._columns[:, rows]]
        w /= np.maximum(w.sum(axis=0), 1e-9)
        x, y, xx, xy, yy, u, v, xu, yu, xv, yv = np.einsum("kn,kfn->fn", w, products)
        xx, xy, yy = xx - x * x, xy - x * y, yy - y * y
        pull = STIFFNESS * (xx + yy) + 1e-6
        px, py = xx + pull, yy + pull
        determinant = px * py - xy * xy
        affine, fitted = np.empty_like(prior), np.empty((2, len(prior)))
        for row, (d, xd, yd, straight) in enumerate(((u, xu, yu, (xx, xy)), (v, xv, yv, (xy, yy)))):
            mx = straight[0] + xd - x * d + pull * prior[:, row, 0]
            my = straight[1] + yd - y * d + pull * prior[:, row, 1]
            a, b = (mx * py - my * xy) / determinant, (my * px - mx * xy) / determinant
            affine[:, row, 0], affine[:, row, 1] = a, b
            fitted[row] = d + (x, y)[row] - a * x - b * y
        return affine, fitted


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


def spacing_px(points_px: Array) -> float:
    """The usual distance between points (P, 2), of which there are two at least: to the third nearest, the median."""
    far = points_px[nearest_neighbours(points_px, SPACING)[:, -1]]
    return float(np.median(np.linalg.norm(far - points_px, axis=1)))
