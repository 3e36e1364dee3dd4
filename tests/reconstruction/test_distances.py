"""D_E and D_M against other ways to compute them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import distance_matrix

from reconstruction import ReconstructionError, distances
from reconstruction.mesh import triangulate
from tests.reconstruction.world import SEEDS, relief


@given(SEEDS, st.integers(2, 50))
def test_euclidean_agrees_with_scipy(rng: np.random.Generator, p: int) -> None:
    rest = rng.normal(size=(3, p))
    np.testing.assert_allclose(distances.euclidean(rest), distance_matrix(rest.T, rest.T), atol=1e-12)


def floyd_warshall(rest: np.ndarray, edges: np.ndarray) -> np.ndarray:
    p = rest.shape[1]
    D = np.full((p, p), np.inf)
    np.fill_diagonal(D, 0.0)
    for i, j in edges:
        D[i, j] = D[j, i] = np.linalg.norm(rest[:, i] - rest[:, j])
    for k in range(p):
        D = np.minimum(D, D[:, k, None] + D[k, None, :])
    return D


@given(SEEDS, st.integers(4, 30))
def test_manhattan_is_the_shortest_path_along_edges(rng: np.random.Generator, p: int) -> None:
    rest = relief(rng, p)
    edges = triangulate(rest[:2].T).edges
    D = distances.manhattan(rest, edges)
    np.testing.assert_allclose(D, floyd_warshall(rest, edges), atol=1e-9)
    np.testing.assert_allclose(D, D.T)
    assert (distances.euclidean(rest) - 1e-9 <= D).all()
    i, j = edges.T
    np.testing.assert_allclose(D[i, j], distances.euclidean(rest)[i, j])


def test_mesh_in_pieces_has_no_paths() -> None:
    rest = np.random.default_rng(0).normal(size=(3, 6))
    with pytest.raises(ReconstructionError, match=r"falls into pieces.*--metric euclidean"):
        distances.manhattan(rest, np.array([[0, 1], [1, 2], [3, 4], [4, 5]]))
