"""Rotations as quaternions, and projection."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reconstruction.camera import (
    Camera,
    left_matrix,
    nearest_rotation,
    quaternion_exp,
    quaternion_from_rotation,
    quaternion_product,
    rotation_from_quaternion,
)
from tests.reconstruction.world import CAMERAS, SEEDS, random_rotation, unit_quaternions

ANGLES = st.floats(-np.pi, np.pi)


@given(SEEDS)
def test_rotation_of_a_product_is_the_product_of_rotations(rng: np.random.Generator) -> None:
    a, b = unit_quaternions(rng, 5), unit_quaternions(rng, 5)
    R = rotation_from_quaternion(quaternion_product(a, b))
    np.testing.assert_allclose(R, rotation_from_quaternion(a) @ rotation_from_quaternion(b), atol=1e-12)
    np.testing.assert_allclose((left_matrix(a) @ b[..., None])[..., 0], quaternion_product(a, b), atol=1e-14)


@given(SEEDS)
def test_rotations_are_orthonormal_and_agree_with_scipy(rng: np.random.Generator) -> None:
    q = unit_quaternions(rng, 7)
    R = rotation_from_quaternion(q)
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)
    np.testing.assert_allclose(R, Rotation.from_quat(q, scalar_first=True).as_matrix(), atol=1e-12)


@given(st.tuples(ANGLES, ANGLES, ANGLES).map(np.array))
def test_exponential_is_inverted_by_its_negative_and_agrees_with_scipy(theta: np.ndarray) -> None:
    q = quaternion_exp(theta)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(quaternion_product(q, quaternion_exp(-theta)), [1, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(rotation_from_quaternion(q), Rotation.from_rotvec(theta).as_matrix(), atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-300, 1e-12, 1e-8])
def test_exponential_of_next_to_nothing(size: float) -> None:
    q = quaternion_exp(np.array([size, -size, size / 2]))
    np.testing.assert_allclose(q, [1, size / 2, -size / 2, size / 4], rtol=1e-12)


@given(SEEDS)
def test_quaternion_comes_back_from_its_rotation(rng: np.random.Generator) -> None:
    (q,) = unit_quaternions(rng, 1)
    found = quaternion_from_rotation(rotation_from_quaternion(q))
    assert found[0] >= 0
    np.testing.assert_allclose(found, q if q[0] >= 0 else -q, atol=1e-9)


@pytest.mark.parametrize("axis", np.eye(3))
def test_half_turns_have_a_quaternion(axis: np.ndarray) -> None:
    R = 2 * np.outer(axis, axis) - np.eye(3)
    np.testing.assert_allclose(rotation_from_quaternion(quaternion_from_rotation(R)), R, atol=1e-12)


@given(SEEDS)
def test_nearest_rotation_is_a_rotation_and_nearer_than_its_neighbours(rng: np.random.Generator) -> None:
    M = rng.normal(size=(4, 3, 3))
    R = nearest_rotation(M)
    np.testing.assert_allclose(R @ R.transpose(0, 2, 1), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)
    others = R @ rotation_from_quaternion(quaternion_exp(rng.normal(size=(30, 1, 3))))
    assert (np.linalg.norm(others - M, axis=(2, 3)) >= np.linalg.norm(R - M, axis=(1, 2)) - 1e-12).all()


@given(SEEDS)
def test_a_rotation_is_its_own_nearest(rng: np.random.Generator) -> None:
    R = random_rotation(rng)
    np.testing.assert_allclose(nearest_rotation(R), R, atol=1e-12)


@given(SEEDS, CAMERAS)
def test_projection_is_that_of_the_intrinsics(rng: np.random.Generator, camera: Camera) -> None:
    points = rng.normal(size=(2, 3, 9)) * 50 + np.array([[0.0], [0.0], [600.0]])
    if not camera.perspective:
        points[:, 2] = 1.0
    image = camera.K @ points
    np.testing.assert_allclose(camera.project(points), image[:, :2] / image[:, 2:], atol=1e-9)


def test_orthography_drops_the_depth() -> None:
    np.testing.assert_allclose(Camera().project(np.array([[1.0], [2.0], [-7.0]])), [[1.0], [2.0]])
