"""Robust weights: points far from where the others say they are count little."""

import numpy as np

from reconstruction.arrays import Array, Mask

RAYLEIGH_MEDIAN = 1.1774  # median length of 2-D vectors whose coordinates have deviation 1
LEAST_SIGMA = 0.02  # of the surface's size: less is what any surface deforms by
ROBUST_SIGMAS = 8.0  # deviations from the model beyond which a point counts less; fewer would silence bends of few modes
GROSS_SIGMAS = 7.0  # deviations from the common motion beyond which a point does not help a new frame to start
CLOSE_SIGMAS = 2.0  # deviations beyond which an entry hardly counts at the end
BROAD_FITS, CLOSE_FITS = 5, 3  # of the motion of one frame
FEWEST_POINTS = 4  # with fewer visible all count


def deviation(distances: Array, least: float) -> float:
    """Deviation of one coordinate of vectors of these lengths (n,), from their median; at least so much."""
    return max(float(np.median(distances)) / RAYLEIGH_MEDIAN, least)


def robust_weights(residuals: Array, visible: Mask, sigmas: float = ROBUST_SIGMAS, least: float = 0.0) -> Array:
    """Weights (p,) by residuals (2, p) over the surface's size: 1 up to some deviations, falling with the fourth power."""
    if visible.sum() < FEWEST_POINTS:
        return visible.astype(np.float64)
    distance = lengths(np.where(visible, residuals, 0.0))
    excess = np.maximum(distance / max(sigmas * deviation(distance[visible], least), 1e-9), 1.0)
    return np.where(visible, excess**-4.0, 0.0)


def start_weights(last: Array, W: Array, visible: Mask, radius: float) -> Array:
    """Weights (p,) of a new frame's points (2, p) px before its pose is known, by their common motion since `last` (3, p).

    Args:
        last: (3, p) the last shape in camera axes and perspective, px.
        W: (2, p) px; anything where not visible.
        visible: (p,).
        radius: the shape's size, px.
    """
    if visible.sum() < FEWEST_POINTS:
        return visible.astype(np.float64)
    off = off_the_common_motion(last, W, visible, GROSS_SIGMAS)
    return robust_weights(off / radius, visible, GROSS_SIGMAS, LEAST_SIGMA)


def off_the_common_motion(shape: Array, W: Array, visible: Mask, limit: float) -> Array:
    """Residuals (2, p) px of points (2, p) about the affine motion of a shape (3, p) that most of them share.

    Args:
        shape: (3, p) px, seen along its third axis.
        W: (2, p) px; anything where not visible.
        visible: (p,), at least one.
        limit: deviations beyond which a point might spoil the motion; without such points the fit ends early.
    """
    size = float(np.sqrt(np.var(shape, axis=1).sum()))
    B = np.concatenate([shape / size, np.ones((1, shape.shape[1]))])[:, visible]
    known = W[:, visible]
    least = LEAST_SIGMA * size
    left = known - shape[:2, visible]
    left = left - np.median(left, axis=1)[:, None]
    for k in range(BROAD_FITS + CLOSE_FITS):
        off = lengths(left)
        sigma = deviation(off, least)
        if k in (0, BROAD_FITS) and off.max() <= limit * (sigma if k else least):
            break
        weighted = B * fit_weights(off / sigma, close=k >= BROAD_FITS)
        gram = weighted @ B.T
        gram += 1e-9 * np.trace(gram) * np.eye(4)
        left = known - np.linalg.solve(gram, weighted @ known.T).T @ B
    residuals = np.zeros_like(W)
    residuals[:, visible] = left
    return residuals


def fit_weights(off: Array, *, close: bool) -> Array:
    """Weights of entries so many deviations off: Geman-McClure's, or those that make far ones count linearly."""
    return geman_mcclure(off / CLOSE_SIGMAS) if close else 1 / (1 + off)


def geman_mcclure(off: Array) -> Array:
    """Weights of entries by how far off they are, over what is far."""
    return np.asarray(1 / (1 + off**2) ** 2)


def lengths(vectors: Array) -> Array:
    """Lengths (..., p) of vectors (..., 2, p)."""
    return np.sqrt(vectors[..., 0, :] ** 2 + vectors[..., 1, :] ** 2)
