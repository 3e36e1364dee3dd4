"""Dissimilarity between the points of the rest shape: the matrix D the modes come from (paper §3.1)."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import pdist, squareform

from reconstruction import ReconstructionError

Array = NDArray[np.float64]


def euclidean(rest: Array) -> Array:
    """D_E (p, p): straight distances between the points of the rest shape (3, p) (Eq. 1)."""
    return np.asarray(squareform(pdist(rest.T)))


def manhattan(rest: Array, edges: NDArray[np.int64]) -> Array:
    """D_M (p, p): shortest paths along the mesh edges (n, 2) of the rest shape (3, p), by Dijkstra.

    Raises:
        ReconstructionError: the mesh falls into pieces, so that some points have no path between them.
    """
    p = rest.shape[1]
    lengths = np.linalg.norm(rest[:, edges[:, 0]] - rest[:, edges[:, 1]], axis=0)
    graph = coo_array((lengths, (edges[:, 0], edges[:, 1])), shape=(p, p)).tocsr()
    D = np.asarray(dijkstra(graph, directed=False))
    if not np.isfinite(D).all():
        raise ReconstructionError(
            "the mesh of the rest shape falls into pieces: use --metric euclidean, or a connected mesh"
        )
    return D
