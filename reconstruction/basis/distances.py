"""Dissimilarity between the points of the rest shape: the matrix D the modes come from (paper §3.1)."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import cdist, pdist, squareform

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices
from reconstruction.basis.mesh import farthest_points
from reconstruction.basis.rest_shape import rms_radius
from reconstruction.settings import Metric, MetricChoice

THINNEST = 0.03  # variance added to each principal axis, as a share of their mean: a flat sheet has none across
AWAY_FROM_ZERO = 0.05  # smallest coordinate of the chi-squared distance, in RMS radii: it compares positive numbers
LANDMARKS, BLUR = 64, 0.5  # points that a point is described by, and how far it spreads among them, in RMS radii


def fitting(metric: MetricChoice, *, flat: bool) -> Metric:
    """The metric itself for `auto`: of a sheet free edges bend, of a solid what is near moves along."""
    if metric != "auto":
        return metric
    return "chi-squared" if flat else "jensen-shannon"


def dissimilarity(metric: Metric, rest: Array, edges: Indices, to: Indices | None = None) -> Array:
    """D (p, p) of the rest shape (3, p) with mesh edges (n, 2), or its columns (p, m) of the points `to` (m,).

    Raises:
        ReconstructionError: manhattan, and the mesh falls into pieces.
    """
    match metric:
        case "manhattan":
            return manhattan(rest, edges, to)
        case "mahalanobis":
            return mahalanobis(rest, to)
        case "chi-squared":
            return chi_squared(rest, to)
        case "jensen-shannon":
            return jensen_shannon(rest, to)
        case _:
            return euclidean(rest, to)


def euclidean(rest: Array, to: Indices | None = None) -> Array:
    """D_E (p, p), or its columns `to`: straight distances between the points of the rest shape (3, p) (Eq. 1)."""
    return between(rest.T, to)


def manhattan(rest: Array, edges: Indices, to: Indices | None = None) -> Array:
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
            "the mesh of the rest shape falls into pieces: use another metric, or a connected mesh", "metric"
        )
    return D if to is None else D.T


def mahalanobis(rest: Array, to: Indices | None = None) -> Array:
    """D (p, p), or its columns `to`: straight distances in units of the shape's (3, p) spread along each axis."""
    covariance = np.cov(rest)
    covariance += THINNEST * np.trace(covariance) / 3 * np.eye(3)
    return between(rest.T @ np.linalg.cholesky(np.linalg.inv(covariance)), to)


def chi_squared(rest: Array, to: Indices | None = None) -> Array:
    """D (p, p), or its columns `to`: √(½ Σ_k (a_k − b_k)²/(a_k + b_k)) of the coordinates along the principal axes.

    Each coordinate is counted once from its least and once from its greatest value, so that no axis has a direction. That
    stretches a surface towards its edges, and the modes of a strip come near Chebyshev's polynomials where straight
    distances give cosines, which are level at the edges: a free edge bends, and few modes follow it.
    """
    centred = rest - rest.mean(axis=1, keepdims=True)
    along = np.linalg.svd(centred, full_matrices=False)[0].T @ centred
    from_ends = np.concatenate([along - along.min(axis=1, keepdims=True), along.max(axis=1, keepdims=True) - along])
    from_ends += AWAY_FROM_ZERO * rms_radius(rest)
    squares = np.zeros((rest.shape[1], rest.shape[1] if to is None else len(to)))
    for a in from_ends:
        b = a if to is None else a[to]
        share = a[:, None] - b
        share *= share
        share /= a[:, None] + b
        squares += share
    return np.sqrt(0.5 * squares)


def jensen_shannon(rest: Array, to: Indices | None = None) -> Array:
    """D (p, p), or its columns `to`: root of the Jensen-Shannon divergence of distributions over well-spread landmarks.

    A point belongs to each landmark with a weight that falls like a Gaussian with their distance. The rest shape may have
    further coordinates (d, p), see `modal_basis`.
    """
    landmarks = rest[:, farthest_points(rest.T, LANDMARKS)]
    weights = np.exp(-0.5 * (cdist(rest.T, landmarks.T) / (BLUR * rms_radius(rest[:3]))) ** 2)
    shares = weights / weights.sum(axis=1, keepdims=True)
    others = shares if to is None else shares[to]
    own, theirs = minus_entropy(shares), minus_entropy(others)
    divergence = np.empty((len(shares), len(others)))
    for row, share, known in zip(divergence, shares, own, strict=True):  # one logarithm where SciPy's distance takes two
        row[:] = 0.5 * (known + theirs) - minus_entropy(0.5 * (share + others))
    return np.sqrt(divergence.clip(0))


def minus_entropy(shares: Array) -> Array:
    """Σ q log q (n,) of distributions (n, d)."""
    return np.asarray(np.einsum("ij,ij->i", shares, np.log(np.maximum(shares, np.finfo(float).tiny))))


def between(points: Array, to: Indices | None) -> Array:
    """Distances (p, p) between points (p, d), or (p, m) to those of them with the indices `to` (m,)."""
    return squareform(pdist(points)) if to is None else cdist(points, points[to])
