"""Poses of what deforms further than any rigid shape explains, and which of them are believed."""

import pickle
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RestShape, RigidMotion, rms_radius
from reconstruction.camera import Camera, nearest_rotation
from reconstruction.evaluation import e3d
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.deforming.attempt import Attempt, Shown, begun, gone_on
from reconstruction.mapping.solid.deforming.learning import POINTS, RIGHTED, learned
from reconstruction.mapping.solid.deforming.low_rank import posed
from reconstruction.mapping.solid.deforming.starts import likeliest, shallower
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.mapping.start import at_once
from reconstruction.settings import Settings
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, relief, seen, shape_error, turns

K, P = 30, 80
FIRST_ARM, SECOND_ARM = 1, 2  # of every four points


def person(camera: Camera, swing: float, seed: int = 2) -> tuple[Array, Array, Array, Mask]:
    """Poses (K, 3, 3) of a body with two arms that swing, its shapes (K, 3, P), and images with noise and gaps."""
    rng = np.random.default_rng(seed)
    shapes = np.repeat(rng.normal(size=(1, 3, P)) * np.array([20.0, 60.0, 12.0])[:, None], K, axis=0)
    for side, arm in ((1, FIRST_ARM), (-1, SECOND_ARM)):
        of_arm = np.arange(P) % 4 == arm
        along = rng.uniform(0.2, 1, of_arm.sum())
        angle = swing * np.sin(np.arange(K) * rng.uniform(0.5, 1.3) + rng.uniform(0, 6))
        way = np.stack([np.full(K, 0.3 * side), -np.cos(angle), np.sin(angle)], axis=1)
        shoulder = np.array([25.0 * side, 50.0, 0.0])[:, None] + 5 * rng.normal(size=(3, of_arm.sum()))
        shapes[:, :, of_arm] = shoulder + 90 * along * way[:, :, None]
    shapes -= shapes.mean(axis=2, keepdims=True)
    R = turns(K, 60.0)
    W, in_camera = seen(shapes, R, camera)
    return R, in_camera, W + 0.2 * rng.normal(size=W.shape), rng.random((K, P)) > 0.1


def off_degrees(R: Array, true: Array) -> float:
    """Median angle between rotations (K, 3, 3), whose objects have other axes."""
    turn = nearest_rotation((R.transpose(0, 2, 1) @ true).sum(axis=0))
    cosine = (np.einsum("kij,jl,kil->k", R, turn, true) - 1) / 2
    return float(np.median(np.degrees(np.arccos(cosine.clip(-1, 1)))))


def test_points_that_no_keyframe_shows_are_in_the_axes_of_the_others() -> None:
    p, K = 600, 24
    shape, R = relief(np.random.default_rng(0), p), turns(K, 30)
    W = seen(np.repeat(shape[None], K, axis=0), R, replace(PERSPECTIVE, center_px=np.zeros(2)))[0]
    visible = np.ones((K, p), bool)
    visible[:, ::20] = False
    known = Bundle(RigidMotion(shape, R, np.ones(K), np.zeros((K, 2))), 1 / PERSPECTIVE.focal_px)
    assert shape_error(posed(W, visible, known, 2, 1e3).shape, shape) < 0.02


def rigid(W: Array, visible: Mask, camera: Camera) -> Map:
    solid = bundle_adjust(np.where(visible[:, None], W, np.nan), visible, camera, refine_focal=False)
    return Map(RestShape("rigid", solid.motion, "made here"), solid.camera)


def elsewhere(function: Callable[..., Any], *arguments: object) -> "Future[Any]":
    """A call as another process gets it."""
    function, *arguments_there = pickle.loads(pickle.dumps((function, *arguments)))
    return at_once(function, *arguments_there)


def bundle(found: Map) -> Bundle:
    return Bundle(found.rest.motion, 1 / found.camera.focal_px)


@pytest.mark.parametrize("times", [1, 1 + POINTS // P])
def test_poses_of_what_swings(times: int) -> None:
    """Also of more points than it looks at: the others are placed by the poses."""
    R, _, W, visible = person(PERSPECTIVE, 1.0)
    W, visible = np.tile(W, times), np.tile(visible, times)
    found = rigid(W, visible, PERSPECTIVE)
    motion = posed(W - PERSPECTIVE.center_px[:, None], visible, bundle(found), 2, 1e3)
    assert off_degrees(motion.R, R) < 0.3 * off_degrees(found.rest.motion.R, R)
    copies = motion.shape.reshape(3, times, P)
    assert np.median(np.abs(copies - copies[:, :1])) < 0.03 * rms_radius(motion.shape)


def test_of_a_shape_and_its_mirror_image_the_one_meant() -> None:
    R, _, W, visible = person(ORTHOGRAPHIC, 0.3)
    found = rigid(W, visible, ORTHOGRAPHIC)
    off = W - ORTHOGRAPHIC.center_px[:, None]
    one, other = (posed(off, visible, way, 2, 1e3).R for way in (bundle(found), bundle(found).reversed()))
    mirror = np.array([1.0, 1.0, -1.0])
    assert one == pytest.approx(other * mirror * mirror[:, None], abs=1e-6)
    assert min(off_degrees(one, R), off_degrees(other, R)) < 15


@pytest.mark.parametrize("seed", [2, 3])
def test_gross_errors_spoil_no_poses(seed: int) -> None:
    R, _, W, visible = person(PERSPECTIVE, 0.3, seed=seed)
    rng = np.random.default_rng(seed)
    W = np.where((rng.random(visible.shape) < 0.1)[:, None], W + 300.0 * rng.normal(size=W.shape), W)
    motion = posed(W - PERSPECTIVE.center_px[:, None], visible, bundle(rigid(W, visible, PERSPECTIVE)), 2, 10.0)
    assert off_degrees(motion.R, R) < 8


@pytest.mark.parametrize(
    ("camera", "swing", "seed", "better", "sure"),
    [
        (PERSPECTIVE, 1.0, 2, True, True),
        pytest.param(PERSPECTIVE, 0.0, 2, False, True, marks=pytest.mark.slow),
        pytest.param(ORTHOGRAPHIC, 1.6, 4, True, False, marks=pytest.mark.slow),
    ],
    ids=["swings", "rigid", "few modes find more about the rigid shape than many"],
)
def test_poses_are_believed_if_they_make_images_likelier(
    camera: Camera, swing: float, seed: int, better: bool, sure: bool
) -> None:
    _, shapes, W, visible = person(camera, swing, seed)
    found = rigid(W, visible, camera)
    shown = Shown(found, Settings(), W, visible, visible, np.arange(K))
    model, first = begun(found, shown, 20)
    start = Attempt(model, learned(model, W, visible, first, first.log_s, RIGHTED), first.log_s)
    other, otherwise = likeliest(start, shown)
    usual = gone_on(start, shown)
    assert (otherwise < 0.1) == sure
    errors = []
    for one in (usual, other):
        state, B = one.known.state, one.known.B
        errors.append(e3d(state.scaled_rotations() @ (B[:3] + state.Lambda @ B[3:-1]), shapes).mean())
    assert errors[1] < 0.6 * errors[0] if better else errors[1] == errors[0]
    assert 0.3 < errors[1] / other.known.deformations.left_open < 1.5 or not better  # about so far off they are known to be


def test_a_shape_half_as_deep_that_turns_twice_as_far_looks_alike() -> None:
    shape, R = np.random.default_rng(0).normal(size=(3, P)), turns(K, 16.0)
    motion = RigidMotion(shape, R @ nearest_rotation(R.sum(axis=0)).T, np.ones(K), np.zeros((K, 2)))
    flatter = shallower(motion, 0.5)
    assert flatter.shape == pytest.approx(shape * [[1], [1], [0.5]], rel=1e-6)
    moved, off = (other.R[:, :2] @ other.shape - motion.shape[:2] for other in (motion, flatter))
    assert np.abs(off - moved).mean() < 0.3 * np.abs(moved).mean()


@pytest.mark.slow
def test_what_shrinks_while_it_turns_hardly_may_be_of_another_depth() -> None:
    rng, points = np.random.default_rng(1), 48
    shape = rng.normal(size=(3, points))
    shape *= 60 / np.linalg.norm(shape, axis=0)
    shape[2] = -np.abs(shape[2])  # the near side of a ball
    shrinking = 1 - 0.8 * np.linspace(0, 1, K)[:, None, None] * (np.arange(points) % 2)
    W, _ = seen(shape * shrinking, turns(K, 8.0), ORTHOGRAPHIC)
    W, visible = W + 0.2 * rng.normal(size=W.shape), np.ones((K, points), bool)
    found = rigid(W, visible, ORTHOGRAPHIC)
    shown = Shown(found, Settings(), W, visible, visible, np.arange(K))
    model, first = begun(found, shown, 20)
    start = Attempt(model, learned(model, W, visible, first, first.log_s, RIGHTED), first.log_s)
    otherwise = likeliest(start, shown)[1]
    assert otherwise > 0.1
    assert likeliest(start, shown, elsewhere)[1] == otherwise
