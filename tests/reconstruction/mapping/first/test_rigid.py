"""Rigid bundle adjustment with the exact camera."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.first.factorization import factorize
from reconstruction.mapping.first.rigid import bundle_adjust, reprojection_rms, solve_points
from tests.reconstruction.world import CAMERAS, PERSPECTIVE, SEEDS, random_rotation, relief, shape_error, turns

FRAMES, POINTS = 14, 40


def scene(rng: np.random.Generator, camera: Camera) -> tuple[np.ndarray, RigidMotion]:
    """Images (F, 2, p) px, and the motion that explains them exactly."""
    shape, R = relief(rng, POINTS), turns(FRAMES)
    s = 1 + 0.1 * np.sin(np.arange(FRAMES) / 3)
    t = 5 * rng.normal(size=(FRAMES, 2))
    placed = s[:, None, None] * R @ shape
    image = (placed[:, :2] + t[:, :, None]) / (1 + placed[:, 2:] / camera.focal_px)
    return image + camera.center_px[:, None], RigidMotion(shape, R, s, t)


@settings(max_examples=10)
@given(rng=SEEDS, camera=CAMERAS)
def test_motion_is_the_perspective_image_of_placed_points(rng: np.random.Generator, camera: Camera) -> None:
    W, motion = scene(rng, camera)
    if camera.perspective:  # depth f/s, seen at t
        depth = camera.focal_px / motion.s
        origin = np.concatenate([motion.t * depth[:, None] / camera.focal_px, depth[:, None]], axis=1)
        placed = motion.R @ motion.shape + origin[:, :, None]
    else:
        placed = motion.s[:, None, None] * motion.R @ motion.shape + np.pad(motion.t, ((0, 0), (0, 1)))[:, :, None]
    np.testing.assert_allclose(camera.project(placed), W, atol=1e-9)
    rms = reprojection_rms(W - camera.center_px[:, None], np.ones((FRAMES, POINTS)), motion, camera)
    assert rms < 1e-9


@settings(max_examples=15)
@given(rng=SEEDS, camera=CAMERAS)
def test_points_are_solved_for_exactly_given_the_poses(rng: np.random.Generator, camera: Camera) -> None:
    W, motion = scene(rng, camera)
    h = (rng.random((FRAMES, POINTS)) < 0.7).astype(float)
    start = replace(motion, shape=motion.shape + rng.normal(size=motion.shape.shape))
    known = np.where(h[:, None] > 0, W - camera.center_px[:, None], 0.0)
    found = solve_points(known, h, start, camera)
    np.testing.assert_allclose(found, motion.shape, atol=0.01)


@settings(max_examples=10)
@given(rng=SEEDS)
def test_adjustment_turns_an_orthographic_guess_into_the_perspective_truth(rng: np.random.Generator) -> None:
    W, truth = scene(rng, PERSPECTIVE)
    visible = rng.random((FRAMES, POINTS)) < 0.8
    guess = factorize(W, visible).motion
    guess = replace(guess, t=guess.t - PERSPECTIVE.center_px)
    both = [bundle_adjust(W, visible, m, PERSPECTIVE, sweeps=150) for m in (guess, guess.mirrored())]
    motion, rms = min(both, key=lambda found: found[1])
    assert rms < 0.25
    assert shape_error(motion.shape, truth.shape) < 0.35 * max(shape_error(guess.shape, truth.shape), 0.02)


@settings(max_examples=10)
@given(rng=SEEDS, camera=CAMERAS)
def test_adjustment_does_not_look_at_hidden_points(rng: np.random.Generator, camera: Camera) -> None:
    W, truth = scene(rng, camera)
    visible = rng.random((FRAMES, POINTS)) < 0.8
    start = replace(truth, shape=truth.shape + rng.normal(size=truth.shape.shape))
    one = bundle_adjust(W, visible, start, camera, sweeps=3)
    two = bundle_adjust(np.where(visible[:, None], W, np.nan), visible, start, camera, sweeps=3)
    np.testing.assert_array_equal(one[0].shape, two[0].shape)
    assert one[1] == two[1]


@given(SEEDS)
def test_first_frames_axes_change_no_image(rng: np.random.Generator) -> None:
    _, truth = scene(rng, PERSPECTIVE)
    elsewhere = replace(truth, R=truth.R @ random_rotation(rng), s=1.7 * truth.s)
    moved = elsewhere.in_first_frame()
    np.testing.assert_allclose(moved.R[0], np.eye(3), atol=1e-12)
    assert moved.s[0] == pytest.approx(1.0)
    before = elsewhere.s[:, None, None] * elsewhere.R @ elsewhere.shape
    np.testing.assert_allclose(moved.s[:, None, None] * moved.R @ moved.shape, before, atol=1e-9)


@given(SEEDS)
def test_the_mirror_image_looks_the_same_to_an_orthographic_camera(rng: np.random.Generator) -> None:
    _, truth = scene(rng, PERSPECTIVE)
    mirrored = truth.mirrored()
    np.testing.assert_allclose((mirrored.R @ mirrored.shape)[:, :2], (truth.R @ truth.shape)[:, :2], atol=1e-9)
    np.testing.assert_allclose((mirrored.R @ mirrored.shape)[:, 2], -(truth.R @ truth.shape)[:, 2], atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(mirrored.R), 1.0)
    np.testing.assert_allclose(mirrored.mirrored().shape, truth.shape)
