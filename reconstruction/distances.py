"""Dissimilarity between the points of the rest shape: the matrix D the modes come from (paper §3.1)."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import cdist, pdist, squareform

from reconstruction import ReconstructionError
from reconstruction.mesh import farthest_points

Array = NDArray[np.float64]
Metric = Literal["euclidean", "manhattan", "mahalanobis", "chi-squared", "jensen-shannon"]

THINNEST = 0.03  # variance added to each principal axis, as a share of their mean: a flat sheet has none across
AWAY_FROM_ZERO = 0.05  # smallest coordinate of the chi-squared distance, in RMS radii: it compares positive numbers
LANDMARKS, BLUR = 64, 0.5  # points that a point is described by, and how far it spreads among them, in RMS radii


def dissimilarity(metric: Metric, rest: Array, edges: NDArray[np.int64]) -> Array:
    """D (p, p) of the rest shape (3, p) with mesh edges (n, 2).

    Raises:
        ReconstructionError: manhattan, and the mesh falls into pieces.
    """
    match metric:
        case "manhattan":
            return manhattan(rest, edges)
        case "mahalanobis":
            return mahalanobis(rest)
        case "chi-squared":
            return chi_squared(rest)
        case "jensen-shannon":
            return jensen_shannon(rest)
        case _:
            return euclidean(rest)


def euclidean(rest: Array) -> Array:
    """D_E (p, p): straight distances between the points of the rest shape (3, p) (Eq. 1)."""
    return np.asarray(squareform(pdist(rest.T)))


def manhattan(rest: Array, edges: NDArray[np.int64], to: NDArray[np.int64] | None = None) -> Array:
    """D_M (p, p), or its columns `to`: shortest paths along the mesh edges (n, 2) of the rest shape (3, p), by Dijkstra.

    Raises:
        ReconstructionError: the mesh falls into pieces, so that some points have no path between them.
    """
    p = rest.shape[1]
    lengths = np.linalg.norm(rest[:, edges[:, 0]] - rest[:, edges[:, 1]], axis=0)
    ends = np.concatenate([edges, edges[:, ::-1]])  # both directions at once: a quarter faster than an undirected graph
    graph = coo_array((np.concatenate([lengths, lengths]), (ends[:, 0], ends[:, 1])), shape=(p, p)).tocsr()
    D = np.asarray(dijkstra(graph, indices=to))
    if not np.isfinite(D).all():
        raise ReconstructionError(
            "the mesh of the rest shape falls into pieces: use --metric euclidean, or a connected mesh"
        )
    return D if to is None else D.T


def mahalanobis(rest: Array) -> Array:
    """D (p, p): straight distances where each principal axis is measured by the rest shape's (3, p) spread along it."""
    covariance = np.cov(rest)
    covariance += THINNEST * np.trace(covariance) / 3 * np.eye(3)
    return np.asarray(squareform(pdist(rest.T, "mahalanobis", VI=np.linalg.inv(covariance))))


def chi_squared(rest: Array) -> Array:
    """D (p, p): √(½ Σ_k (a_k − b_k)²/(a_k + b_k)) of the coordinates along the principal axes.

    Each coordinate is counted once from its least and once from its greatest value, so that no axis has a direction.
    """
    centred = rest - rest.mean(axis=1, keepdims=True)
    along = np.linalg.svd(centred, full_matrices=False)[0].T @ centred
    from_ends = np.concatenate([along - along.min(axis=1, keepdims=True), along.max(axis=1, keepdims=True) - along])
    from_ends += AWAY_FROM_ZERO * rms_radius(rest)
    squares = sum((a[:, None] - a) ** 2 / (a[:, None] + a) for a in from_ends)
    return np.asarray(np.sqrt(0.5 * squares))


def jensen_shannon(rest: Array) -> Array:
    """D (p, p): root of the Jensen-Shannon divergence between the points' distributions over well-spread landmarks.

    A point belongs to each landmark with a weight that falls like a Gaussian with their distance.
    """
    landmarks = rest[:, farthest_points(rest.T, LANDMARKS)]
    weights = np.exp(-0.5 * (cdist(rest.T, landmarks.T) / (BLUR * rms_radius(rest))) ** 2)
    shares = weights / weights.sum(axis=1, keepdims=True)
    return np.asarray(squareform(pdist(shares, "jensenshannon")))


def rms_radius(rest: Array) -> float:
    """RMS distance of the points (3, p) to their centroid."""
    return float(np.sqrt(rest.var(axis=1).sum()))
