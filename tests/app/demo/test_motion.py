"""The sheet of the sample: it does not stretch, turns first and then bends, and can be tracked."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from app import demo

FRAMES = st.integers(0, demo.FRAMES - 1)


def edges() -> NDArray[np.int64]:
    faces = demo.grid()[1]
    return np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])), axis=0)


def rigid_error(flat: NDArray[np.float64], shape: NDArray[np.float64]) -> float:
    """Share of the shape (n, 3) that the best rotation of the flat sheet (n, 3) leaves."""
    shape = shape - shape.mean(axis=0)
    U, _, Vt = np.linalg.svd(flat.T @ shape)
    turned = flat @ (U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt)
    return float(np.linalg.norm(turned - shape) / np.linalg.norm(shape))


@given(FRAMES)
def test_the_sheet_does_not_stretch(frame: int) -> None:
    xy_mm, _ = demo.grid()
    a, b = edges().T
    flat = np.linalg.norm(xy_mm[a] - xy_mm[b], axis=1)
    shape = demo.true_shape(frame)
    assert np.abs(np.linalg.norm(shape[a] - shape[b], axis=1) / flat - 1).max() < 0.005


def test_first_two_seconds_are_rigid_and_turn_enough() -> None:
    xy_mm, _ = demo.grid()
    flat = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
    normals = []
    for frame in range(demo.RIGID_FRAMES):
        shape = demo.true_shape(frame)
        assert rigid_error(flat, shape) < 1e-9
        normals.append(demo.surface(frame).normals(np.zeros((1, 2)))[0])
    yaw, pitch = np.degrees(np.arctan2(np.array(normals)[:, :2], -np.array(normals)[:, 2:])).T
    for angle in (yaw, pitch):
        assert angle.min() < -14
        assert angle.max() > 14
    assert 5 < np.degrees(np.arccos(-normals[0][2])) < 12


def test_then_it_bends_substantially() -> None:
    xy_mm, _ = demo.grid()
    flat = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
    errors = [rigid_error(flat, demo.true_shape(frame)) for frame in range(0, demo.FRAMES, 2)]
    assert 0.08 < np.mean(errors) < 0.12


def test_it_can_be_tracked_inside_facing_and_slow() -> None:
    xy_mm, _ = demo.grid()
    before = None
    for frame in range(demo.FRAMES):
        shape = demo.true_shape(frame)
        points = demo.project(shape)
        assert points.min() > 5
        assert (points < np.array(demo.SIZE) - 5).all()
        sight = shape / np.linalg.norm(shape, axis=1, keepdims=True)
        facing = -(sight * demo.surface(frame).normals(xy_mm)).sum(axis=1)
        assert np.degrees(np.arccos(facing.min())) < 61
        if before is not None:
            assert np.linalg.norm(points - before, axis=1).max() < 8
        before = points
