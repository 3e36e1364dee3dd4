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
ROUNDS = 4  # of re-weighting
NOISE_PX = 0.5  # least scale of disagreement: tracking noise and curvature between neighbours
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


def local_motion(
    reference_px: Array, current_px: Array, weight: Array, neighbours: Indices, prior: Array
) -> LocalMotion:
    """Robust local affine maps from the reference to now; points that disagree lose their say.

    Args:
        reference_px: (P, 2) points in the reference frame.
        current_px: (P, 2) the same now; NaN where unknown.
        weight: (P,) confidence in `current_px`, 0 where unknown.
        neighbours: (P, k) of `nearest_neighbours`.
        prior: (P, 2, 2) maps to fall back on where neighbours are few or in line.
    """
    known = np.where(weight[:, None] > 0, current_px, 0.0)
    trust = weight
    for _ in range(ROUNDS):
        affine, fitted, support = _fit(reference_px, known, trust, neighbours, prior)
        residual = np.linalg.norm(known - fitted, axis=1)
        judged = (weight > 0) & (support >= MIN_SUPPORT)
        scale = NOISE_PX
        if judged.any():
            scale = max(scale, 1.4826 * float(np.median(residual[judged])))
        trust = np.where(judged, weight / (1.0 + (residual / (2.0 * scale)) ** 2), weight)
    consistent = ~judged | (residual < OUTLIER * scale)
    return LocalMotion(affine, fitted, support, consistent)


def _fit(
    reference: Array, current: Array, weight: Array, neighbours: Indices, prior: Array
) -> tuple[Array, Array, Array]:
    """Weighted least squares of each neighbourhood about its centroid: maps, predictions, support."""
    w = weight[neighbours]
    support = w.sum(axis=1)
    share = (w / np.maximum(support, 1e-9)[:, None])[:, None, :]
    x, y = reference[neighbours], current[neighbours]
    x_mean, y_mean = share @ x, share @ y
    x, y = x - x_mean, y - y_mean
    xw = np.swapaxes(x, 1, 2) * share
    Sxx, Sxy = xw @ x, xw @ y
    pull = STIFFNESS * np.trace(Sxx, axis1=1, axis2=2) + 1e-6
    Sxx[:, (0, 1), (0, 1)] += pull[:, None]
    Sxy += pull[:, None, None] * np.swapaxes(prior, 1, 2)
    affine = np.swapaxes(np.linalg.solve(Sxx, Sxy), 1, 2)
    offset = (reference - x_mean[:, 0])[:, :, None]
    return affine, y_mean[:, 0] + (affine @ offset)[:, :, 0], support
