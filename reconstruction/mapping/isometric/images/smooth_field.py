"""Smooth functions on the points of one image: what depths and image positions of a bending sheet are made of.

They are fitted through points whatever a few of these say: Geman-McClure weights.
"""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.window.robust import RAYLEIGH_MEDIAN, geman_mcclure

FEW_FUNCTIONS = 40  # where bending is held firmly
ROUGH_SWEEPS = 4  # of re-weighting, with few functions and few points
SWEEPS = 3  # more with all functions, the last with all points
ENOUGH = 0.8  # of the few points that must be seen
GROSS = 8.0  # times the usual residual: not the same point
FINEST = 1e-4  # of the image's RMS radius: no residual is usually smaller
RANK = 1e-9  # of the largest eigenvalue, less of which is none
NO_CREASES = np.zeros((0, 3))
FOLDS_EASILY = 0.01  # stiffness of a crease: hardly any, but with half a sheet in sight it is not needed


@dataclass(frozen=True)
class SmoothField:
    """The affine functions 1, x, y, two for each crease, and leading eigenfunctions of the thin-plate kernel over m nodes.

    Across a crease shapes are not smooth: its functions are |d| and |d| t, d the distance from it and t the way along it.
    The eigenfunctions are defined everywhere: u_k(x) = √m (Σ_i w_ik |x − x_i|² log|x − x_i| + affine part), with unit
    mean square over the nodes. Coordinates are centred and in units of the nodes' RMS radius.

    Attributes:
        nodes: (m, 2) in those units.
        centre: (2,) of the nodes, in the image's units.
        radius: RMS distance of the nodes from it.
        weights: (m, r - 3 - 2k) kernel weights w, times √m.
        affine: (3, r - 3 - 2k) affine parts, times √m.
        stiffness: (r,) bending energy of each function of unit size, 1 for the softest that bends; 0 for the affine ones.
        creases: (k, 3) lines n · x = c in the image: unit normal n and c.
    """

    nodes: Array
    centre: Array
    radius: float
    weights: Array
    affine: Array
    stiffness: Array
    creases: Array

    def at(self, points: Array) -> Array:
        """Values (n, r) of all functions at points (2, n) of the image."""
        x = (points.T - self.centre) / self.radius
        flat = np.column_stack([np.ones(len(x)), x])
        bent = thin_plate(x, self.nodes) @ self.weights + flat @ self.affine
        d, t = self.beside(points)
        return np.concatenate([flat, np.abs(d), np.abs(d) * t, bent], axis=1)

    def slopes_at(self, points: Array) -> Array:
        """Derivatives (n, r, 2) of all functions by the place of points (2, n) of the image."""
        x = (points.T - self.centre) / self.radius
        apart = x.T[:, :, None] - self.nodes.T[:, None]  # (2, n, m)
        bent = (apart * (np.log((apart**2).sum(axis=0) + 1e-18) + 1)) @ self.weights + self.affine[1:, None]
        flat = np.broadcast_to(np.eye(3)[1:, None], (2, len(x), 3))
        d, t = self.beside(points)
        across, along = self.creases[:, :2].T[:, None], self._along.T[:, None]
        first, second = np.sign(d) * across, np.sign(d) * across * t + np.abs(d) * along
        return np.asarray(np.concatenate([flat, first, second, bent], axis=2).transpose(1, 2, 0) / self.radius)

    def sides(self, points: Array) -> Mask:
        """On which side (n, k) of each crease points (2, n) of the image are."""
        return np.asarray(self.creases[:, 2] < points.T @ self.creases[:, :2].T)

    def beside(self, points: Array) -> tuple[Array, Array]:
        """How far points (2, n) of the image are from each crease, and how far along it: (n, k) each, in radii."""
        d = (points.T @ self.creases[:, :2].T - self.creases[:, 2]) / self.radius
        return d, (points.T - self.centre) @ self._along.T / self.radius

    @property
    def _along(self) -> Array:
        """(k, 2) unit vectors along the creases."""
        return np.column_stack([-self.creases[:, 1], self.creases[:, 0]])


def thin_plate(x: Array, y: Array) -> Array:
    """Kernel (n, m) d² log d of the distances between points x (n, 2) and y (m, 2)."""
    squared = np.maximum((x**2).sum(axis=1)[:, None] - 2 * x @ y.T + (y**2).sum(axis=1), 0.0)
    return np.asarray(0.5 * squared * np.log(squared + 1e-18))


def smooth_field(nodes: Array, functions: int, creases: Array = NO_CREASES) -> SmoothField:
    """The field of so many functions over nodes (2, m) of an image, fewer of fewer nodes; and those of creases (k, 3)."""
    centre = nodes.mean(axis=1)
    radius = float(np.sqrt(((nodes.T - centre) ** 2).sum(axis=1).mean()))
    x = (nodes.T - centre) / radius
    kernel = thin_plate(x, x)
    Q, R = np.linalg.qr(np.column_stack([np.ones(len(x)), x]))
    off = np.eye(len(x)) - Q @ Q.T
    values, U = np.linalg.eigh(off @ kernel @ off)
    leading = np.argsort(-np.abs(values))[: max(0, min(functions, len(x)) - 3)]
    leading = leading[np.abs(values[leading]) > RANK * np.abs(values).max()]  # less of nodes on top of each other
    values, U = values[leading], U[:, leading]
    size = np.sqrt(len(x))
    w = U / values
    affine = -np.linalg.solve(R, Q.T @ (kernel @ w))
    folds = np.full(2 * len(creases), FOLDS_EASILY)
    stiffness = np.concatenate([np.zeros(3), folds, np.abs(values[:1].sum() / values)])
    return SmoothField(x, centre, radius, w * size, affine * size, stiffness, creases)


def robust_fit(
    B: Array, w: Array, seen: Mask, stiffness: Array, firmness: float, few: Indices | None = None
) -> tuple[Array, Array, float]:
    """Smooth function through image points w (2, p), Geman-McClure weights, B (p, r) the functions at the points.

    Gross errors must not bend it: it is stiff at first, and made of the first functions and of the few points only.

    Returns:
        coefficients (r, 2), weights (p,), usual residual of a coordinate.
    """
    every = np.flatnonzero(seen)
    some = every if few is None else spread_rows(seen, few)
    finest = FINEST * float(np.sqrt(np.var(w[:, some], axis=1).sum()))
    h, done, c = np.ones(len(some)), 0, np.zeros((0, 2))
    for rows, r, sweeps in (
        (some, FEW_FUNCTIONS, ROUGH_SWEEPS),
        (some, len(stiffness), SWEEPS - 1),
        (every, len(stiffness), 1),
    ):
        Bs, ws = B[rows, :r], w[:, rows].T
        if done:
            h = weights_of(ws - Bs[:, : len(c)] @ c, finest)[0]
        for _ in range(sweeps):
            done += 1
            firm = max(firmness, 10.0**-done)
            c, _ = weighted_fit(Bs, ws, h, firm * stiffness[:r])
            h, usual = weights_of(ws - Bs @ c, finest)
    weights = np.zeros(len(B))
    weights[every] = h
    return c, weights, usual


def weighted_fit(B: Array, target: Array, h: Array, held: Array) -> tuple[Array, Array]:
    """Coefficients (r, 2) of functions B (n, r) through a target (n, 2) weighted by h, held back; and the normal matrix."""
    weighted = B.T * (h / h.sum())
    gram = weighted @ B
    gram[np.diag_indices(len(gram))] += held + 1e-12
    return np.linalg.solve(gram, weighted @ target), gram


def weights_of(residual: Array, finest: float) -> tuple[Array, float]:
    """Geman-McClure weights (n,) of residuals (n, 2), and the usual residual of a coordinate."""
    off = np.sqrt((residual**2).sum(axis=1))
    usual = max(float(np.partition(off, len(off) // 2)[len(off) // 2]) / RAYLEIGH_MEDIAN, finest)
    return geman_mcclure(off / (GROSS * usual)), usual


def spread_rows(seen: Mask, few: Indices) -> Indices:
    """Well-spread points among those seen (p,): of the few if there are enough of them, else all."""
    rows = few[seen[few]]
    return rows if len(rows) > ENOUGH * len(few) else np.flatnonzero(seen)
