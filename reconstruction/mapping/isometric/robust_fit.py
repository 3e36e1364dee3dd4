"""Smooth functions through the points of an image, whatever a few of them say: Geman-McClure weights."""

import numpy as np

from reconstruction.arrays import Array, Indices, Mask

FEW_FUNCTIONS = 40  # where bending is held firmly
ROUGH_SWEEPS = 4  # of re-weighting, with few functions and few points
SWEEPS = 3  # more with all functions, the last with all points
ENOUGH = 0.8  # of the few points that must be seen
GROSS = 8.0  # times the usual residual: not the same point
FINEST = 1e-4  # of the image's RMS radius: no residual is usually smaller


def robust_fit(
    B: Array, w: Array, seen: Mask, stiffness: Array, firmness: float, few: Indices | None = None
) -> tuple[Array, Array, Mask, float]:
    """Smooth function through image points w (2, p), Geman-McClure weights, B (p, r) the functions at the points.

    Gross errors must not bend it: it is stiff at first, and made of the first functions and of the few points only.

    Returns:
        coefficients (r, 2), weights (p,), inliers (p,), usual residual of a coordinate.
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
            h, off, usual = weights_of(ws - Bs @ c, finest)
    weights, inlier = np.zeros(len(B)), np.zeros(len(B), bool)
    weights[every], inlier[every] = h, off < GROSS * usual
    return c, weights, inlier, usual


def weighted_fit(B: Array, target: Array, h: Array, held: Array) -> tuple[Array, Array]:
    """Coefficients (r, 2) of functions B (n, r) through a target (n, 2) weighted by h, held back; and the normal matrix."""
    weighted = B.T * (h / h.sum())
    gram = weighted @ B
    gram[np.diag_indices(len(gram))] += held + 1e-12
    return np.linalg.solve(gram, weighted @ target), gram


def weights_of(residual: Array, finest: float) -> tuple[Array, Array, float]:
    """Geman-McClure weights (n,) of residuals (n, 2), their lengths (n,), and the usual residual of a coordinate."""
    off = np.sqrt((residual**2).sum(axis=1))
    usual = max(float(np.partition(off, len(off) // 2)[len(off) // 2]) / 1.1774, finest)  # of a Rayleigh distribution
    return 1 / (1 + (off / (GROSS * usual)) ** 2) ** 2, off, usual


def spread_rows(seen: Mask, few: Indices) -> Indices:
    """Well-spread points among those seen (p,): of the few if there are enough of them, else all."""
    rows = few[seen[few]]
    return rows if len(rows) > ENOUGH * len(few) else np.flatnonzero(seen)
