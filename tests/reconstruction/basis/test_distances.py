"""D_E and D_M against other ways to compute them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import distance_matrix
from scipy.spatial.distance import cdist

from reconstruction import ReconstructionError
from reconstruction.basis import distances
from reconstruction.basis.mesh import farthest_points, triangulate
from reconstruction.basis.rest_shape import rms_radius
from reconstruction.settings import Metric
from tests.reconstruction.world import SEEDS, flat, random_rotation, relief

OURS: tuple[Metric, ...] = ("mahalanobis", "chi-squared", "jensen-shannon")
NO_EDGES = np.empty((0, 2), np.int64)


@given(SEEDS, st.integers(2, 50))
def test_euclidean_agrees_with_scipy(rng: np.random.Generator, p: int) -> None:
    rest = rng.normal(size=(3, p))
    np.testing.assert_allclose(distances.euclidean(rest), distance_matrix(rest.T, rest.T), atol=1e-12)


@given(SEEDS, st.integers(4, 40))
def test_jensen_shannon_agrees_with_scipy(rng: np.random.Generator, p: int) -> None:
    rest = relief(rng, p)
    landmarks = rest[:, farthest_points(rest.T, distances.LANDMARKS)]
    weights = np.exp(-0.5 * (distance_matrix(rest.T, landmarks.T) / (distances.BLUR * rms_radius(rest))) ** 2)
    expected = cdist(weights, weights, "jensenshannon")  # it makes them shares
    np.testing.assert_allclose(distances.jensen_shannon(rest), expected, atol=1e-7)
    np.testing.assert_allclose(distances.jensen_shannon(rest, np.arange(3)), expected[:, :3], atol=1e-7)


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
    with pytest.raises(ReconstructionError, match=r"falls into pieces: use another metric"):
        distances.manhattan(rest, np.array([[0, 1], [1, 2], [3, 4], [4, 5]]))


@pytest.mark.parametrize("metric", OURS)
@pytest.mark.parametrize("surface", [relief, flat])
@given(rng=SEEDS)
def test_others_are_dissimilarities_whatever_the_pose_and_size(rng, metric: Metric, surface) -> None:  # type: ignore[no-untyped-def]
    rest = surface(rng, 30)
    D = distances.dissimilarity(metric, rest, NO_EDGES)
    assert np.isfinite(D).all()
    np.testing.assert_allclose(D, D.T)
    np.testing.assert_array_equal(np.diag(D), 0)
    assert D[~np.eye(30, dtype=bool)].min() > 0
    moved = distances.dissimilarity(metric, 3.0 * random_rotation(rng) @ rest + rng.normal(size=(3, 1)), NO_EDGES)
    np.testing.assert_allclose(moved / moved.max(), D / D.max(), atol=1e-6)


@given(SEEDS)
def test_mahalanobis_sees_no_stretch_of_a_solid(rng: np.random.Generator) -> None:
    rest = rng.normal(size=(3, 500))
    longer = np.array([[2.0], [1.0], [1.0]]) * rest
    D, stretched = distances.mahalanobis(rest), distances.mahalanobis(longer)
    np.testing.assert_allclose(stretched, D, rtol=0.06)


def test_chi_squared_sees_more_near_the_ends() -> None:
    line = np.stack([np.linspace(-1, 1, 41), np.zeros(41), np.zeros(41)])
    steps = np.diag(distances.chi_squared(line), 1)
    np.testing.assert_allclose(steps, steps[::-1])
    assert (np.diff(steps[:20]) < 0).all()


def test_jensen_shannon_levels_off_far_away() -> None:
    line = np.stack([np.linspace(-1, 1, 41), np.zeros(41), np.zeros(41)])
    D = distances.jensen_shannon(line)
    assert D.max() <= np.sqrt(np.log(2))
    assert D[0, 40] < 1.1 * D[0, 30]
    assert D[0, 10] > 0.45 * D[0, 30]
