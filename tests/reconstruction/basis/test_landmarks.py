"""Modes of many points from distances to a few of them, against the exact ones."""

from typing import get_args

import numpy as np
import pytest
from scipy.linalg import subspace_angles

from reconstruction import ReconstructionError
from reconstruction.basis import distances, landmarks, modes
from reconstruction.basis.mesh import Mesh, triangulate
from reconstruction.basis.modes import doubly_centred, modal_basis
from reconstruction.settings import Metric
from tests.reconstruction.world import flat, relief

METRICS: tuple[Metric, ...] = get_args(Metric)


def surface(p: int) -> tuple[np.ndarray, Mesh]:
    rest = relief(np.random.default_rng(p), p)
    return rest, triangulate(rest[:2].T)


@pytest.mark.parametrize("metric", METRICS)
def test_leading_modes_are_those_of_all_distances(metric: Metric) -> None:
    rest, mesh = surface(1200)
    exact = modal_basis(rest, mesh, 30, metric)
    values, vectors = landmarks.leading_eigenpairs(rest, mesh.edges, 30, metric)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(30), atol=1e-9)
    np.testing.assert_allclose(vectors.sum(axis=0), 0, atol=1e-9)  # no mode moves the centroid
    np.testing.assert_allclose(values[:10], exact.eigenvalues[:10], rtol=0.02)
    np.testing.assert_allclose(values, exact.eigenvalues, rtol=0.1)
    assert np.rad2deg(subspace_angles(vectors[:, :10], exact.Upsilon[:10].T)).max() < 2.0
    assert np.rad2deg(subspace_angles(vectors, exact.Upsilon.T)).max() < 10.0


@pytest.mark.parametrize("metric", METRICS)
def test_with_every_point_a_landmark_the_modes_are_exact(metric: Metric, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(landmarks, "NEGLIGIBLE", 1e-12)
    rest, mesh = surface(150)
    exact = modal_basis(rest, mesh, 10, metric)
    values, vectors = landmarks.leading_eigenpairs(rest, mesh.edges, 10, metric)
    np.testing.assert_allclose(values, exact.eigenvalues, rtol=1e-6)
    assert subspace_angles(vectors, exact.Upsilon.T).max() < 1e-5


@pytest.mark.parametrize("metric", METRICS)
def test_distances_to_landmarks_are_columns_of_all(metric: Metric) -> None:
    rest, mesh = surface(200)
    chosen = np.array([3, 77, 199])
    every = distances.dissimilarity(metric, rest, mesh.edges)
    np.testing.assert_allclose(distances.dissimilarity(metric, rest, mesh.edges, chosen), every[:, chosen], atol=1e-7)


def test_a_flat_sheet_has_its_modes_too() -> None:
    rest = flat(np.random.default_rng(0), 1000)
    mesh = triangulate(rest[:2].T)
    exact = modal_basis(rest, mesh, 10)
    _, vectors = landmarks.leading_eigenpairs(rest, mesh.edges, 10, "euclidean")
    assert np.rad2deg(subspace_angles(vectors, exact.Upsilon.T)).max() < 3.0


def test_a_mesh_in_pieces_is_refused() -> None:
    rest, mesh = surface(100)
    left = mesh.edges[(rest[0, mesh.edges] < 0).all(axis=1)]
    right = mesh.edges[(rest[0, mesh.edges] >= 0).all(axis=1)]
    with pytest.raises(ReconstructionError, match="falls into pieces"):
        landmarks.leading_eigenpairs(rest, np.concatenate([left, right]), 5, "manhattan")


@pytest.mark.parametrize("metric", METRICS)
def test_many_points_take_the_short_way(metric: Metric, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(modes, "EXACT_POINTS", 500)
    rest, mesh = surface(600)
    basis = modal_basis(rest, mesh, 8, metric)
    doubled = doubly_centred(distances.dissimilarity(metric, rest, mesh.edges)) @ basis.Upsilon.T
    np.testing.assert_allclose(doubled, basis.Upsilon.T * basis.eigenvalues, atol=0.05 * basis.eigenvalues[0])
    largest = np.abs(basis.Upsilon).argmax(axis=1)
    assert (basis.Upsilon[np.arange(8), largest] > 0).all()
    np.testing.assert_array_equal(modal_basis(rest, mesh, 8, metric).Upsilon, basis.Upsilon)  # runs repeat exactly


def test_there_are_landmarks_for_any_number_of_modes() -> None:
    rest, mesh = surface(700)
    values, vectors = landmarks.leading_eigenpairs(rest, mesh.edges, 120, "euclidean")
    assert vectors.shape == (700, 120)
    assert (np.diff(values) <= 0).all()
    assert values[-1] > 0
