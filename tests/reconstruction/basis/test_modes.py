"""The modes of a rest shape: centring, eigenvectors, principal axes, and the linear subspace."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction import ReconstructionError
from reconstruction.basis import distances
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modal_basis import ModalBasis, principal_axes, with_fixed_signs
from reconstruction.basis.modes import doubly_centred, leading_eigenpairs, modal_basis
from reconstruction.settings import Metric
from tests.reconstruction.world import SEEDS, flat, relief

METRICS: tuple[Metric, ...] = get_args(Metric)


def basis_of(rest: np.ndarray, modes: int, metric: Metric = "euclidean") -> ModalBasis:
    return modal_basis(rest, triangulate(rest[:2].T), modes, metric)


@given(SEEDS, st.integers(3, 60))
def test_centring_is_that_of_the_centring_matrix(rng: np.random.Generator, p: int) -> None:
    D = distances.euclidean(rng.normal(size=(3, p)))
    C = np.eye(p) - 1 / p
    centred = doubly_centred(D)
    np.testing.assert_allclose(centred, -0.5 * C @ D @ C, atol=1e-12)
    np.testing.assert_allclose(centred.sum(axis=0), 0, atol=1e-10)
    np.testing.assert_allclose(centred.sum(axis=1), 0, atol=1e-10)


@given(SEEDS, st.integers(5, 60), st.sampled_from([relief, flat]))
def test_unsquared_distances_have_one_zero_eigenvalue_and_no_negative_one(rng, p, surface) -> None:  # type: ignore[no-untyped-def]
    values = np.linalg.eigvalsh(doubly_centred(distances.euclidean(surface(rng, p))))
    assert abs(values[0]) < 1e-9 * values[-1]
    assert (values[1:] > 1e-6 * values[-1]).all()


@pytest.mark.parametrize(("p", "modes"), [(30, 5), (30, 29), (230, 8), (230, 100)])
@pytest.mark.parametrize("metric", METRICS)
def test_modes_are_the_leading_eigenvectors(p: int, modes: int, metric: Metric) -> None:
    rest = relief(np.random.default_rng(p), p)
    basis = basis_of(rest, modes, metric)
    D = distances.dissimilarity(metric, rest - rest.mean(axis=1, keepdims=True), triangulate(rest[:2].T).edges)
    centred = doubly_centred(D)
    values = np.linalg.eigvalsh(centred)[::-1]
    np.testing.assert_allclose(basis.eigenvalues, values[:modes], rtol=1e-8)
    np.testing.assert_allclose(basis.Upsilon @ basis.Upsilon.T, np.eye(modes), atol=1e-9)
    np.testing.assert_allclose(centred @ basis.Upsilon.T, basis.Upsilon.T * basis.eigenvalues, atol=1e-7 * values[0])
    np.testing.assert_allclose(basis.Upsilon.sum(axis=1), 0, atol=1e-6)  # no mode moves the centroid


@given(SEEDS, st.integers(8, 40))
def test_principal_axes_are_a_rotation_with_fixed_signs(rng: np.random.Generator, p: int) -> None:
    rest = relief(rng, p)
    Phi = principal_axes(rest)
    np.testing.assert_allclose(Phi.T @ Phi, np.eye(3), atol=1e-12)
    assert np.linalg.det(Phi) == pytest.approx(1.0)
    spread = ((Phi.T @ rest) ** 2).sum(axis=1)
    assert (np.diff(spread) <= 0).all()
    scatter = Phi.T @ rest @ rest.T @ Phi
    np.testing.assert_allclose(scatter, np.diag(spread), atol=1e-8 * spread[0])
    for axis in Phi.T[:2]:
        assert axis[np.abs(axis).argmax()] > 0
    np.testing.assert_allclose(principal_axes(rest + 1000.0), Phi, atol=1e-6)  # wherever the shape is


def test_the_normal_of_a_flat_sheet_is_its_normal() -> None:
    Phi = principal_axes(flat(np.random.default_rng(1), 30))
    np.testing.assert_allclose(np.abs(Phi[:, 2]), [0, 0, 1], atol=1e-12)


@given(SEEDS)
def test_signs_do_not_depend_on_the_solver(rng: np.random.Generator) -> None:
    vectors = rng.normal(size=(9, 4))
    np.testing.assert_array_equal(with_fixed_signs(vectors), with_fixed_signs(vectors * [1, -1, -1, 1]))


@given(SEEDS, st.integers(1, 9))
def test_linear_subspace_is_the_same_model(rng: np.random.Generator, r: int) -> None:
    basis = basis_of(relief(rng, 25), r)
    Lambda = rng.normal(size=(3, r)) * 20
    B = basis.linear_basis()
    assert B.shape == (3 * r, 3, 25)
    np.testing.assert_allclose(basis.rest + np.tensordot(Lambda.ravel(), B, 1), basis.deform(Lambda), atol=1e-10)


@given(SEEDS)
def test_deforming_many_frames_is_deforming_each(rng: np.random.Generator) -> None:
    basis = basis_of(relief(rng, 20), 4)
    Lambda = rng.normal(size=(5, 3, 4))
    np.testing.assert_allclose(basis.deform(Lambda), np.stack([basis.deform(L) for L in Lambda]))
    np.testing.assert_allclose(basis.deform(np.zeros((3, 4))), basis.rest)


@given(SEEDS)
def test_a_larger_shape_has_the_same_modes(rng: np.random.Generator) -> None:
    rest = relief(rng, 40)
    one, two = basis_of(rest, 6), basis_of(2 * rest + 100, 6)
    np.testing.assert_allclose(two.Upsilon, one.Upsilon, atol=1e-8)
    np.testing.assert_allclose(two.eigenvalues, 2 * one.eigenvalues)
    np.testing.assert_allclose(two.Phi, one.Phi, atol=1e-9)


@given(SEEDS)
def test_reordered_points_have_reordered_modes(rng: np.random.Generator) -> None:
    rest, order = relief(rng, 40), rng.permutation(40)
    one, two = basis_of(rest, 6), basis_of(rest[:, order], 6)
    np.testing.assert_allclose(two.Upsilon, one.Upsilon[:, order], atol=1e-8)
    np.testing.assert_allclose(two.Phi, one.Phi, atol=1e-9)


def test_lanczos_repeats_exactly() -> None:
    D = doubly_centred(distances.euclidean(relief(np.random.default_rng(3), 300)))
    first, second = leading_eigenpairs(D, 10), leading_eigenpairs(D.copy(), 10)
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])


@pytest.mark.parametrize("modes", [0, 20, 21])
def test_as_many_modes_as_points_are_refused(modes: int) -> None:
    with pytest.raises(ReconstructionError, match=rf"modes {modes} does not fit 20 points: choose 1 to 19"):
        basis_of(relief(np.random.default_rng(0), 20), modes)
