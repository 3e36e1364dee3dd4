"""How a solid is begun: by factorisation of all views, or view by view."""

import numpy as np
import pytest
from hypothesis import given, settings

from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera, quaternion_exp, rotation_from_quaternion
from reconstruction.mapping.solid.adjustment import Adjustment
from reconstruction.mapping.solid.building import Build
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.growth import growth_from
from reconstruction.mapping.solid.placing import located
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.mapping.solid.views import likeness
from tests.reconstruction.world import CAMERAS, ORTHOGRAPHIC, PERSPECTIVE, SEEDS, flat, relief, seen, shape_error, turns

VIEWS = 24


def ball(rng: np.random.Generator, points: int = 200) -> np.ndarray:
    """(3, p) a lumpy ball, px."""
    way = rng.normal(size=(3, points))
    way /= np.linalg.norm(way, axis=0)
    lumps = 1 + 0.2 * np.sin(3 * rng.normal(size=3) @ way) + 0.15 * np.sin(4 * rng.normal(size=3) @ way)
    return np.array([[100.0], [80.0], [70.0]]) * lumps * way


def round_about(degrees: float) -> np.ndarray:
    """(K, 3, 3) turns about an upright axis, and nodding a little."""
    angle = np.deg2rad(np.linspace(0, degrees, VIEWS))
    return rotation_from_quaternion(quaternion_exp(np.column_stack([0.15 * np.sin(3 * angle), angle, 0 * angle])))


@pytest.mark.parametrize("degrees", [90.0, 180.0])
@given(SEEDS, CAMERAS)
@settings(max_examples=3, deadline=None)
def test_a_thing_that_hides_its_far_side_comes_back(degrees: float, rng: np.random.Generator, camera: Camera) -> None:
    shape = ball(rng)
    W, placed = seen(np.repeat(shape[None], VIEWS, axis=0), round_about(degrees), camera, depth=1.2)
    deep = placed[:, 2] - placed[:, 2].mean(axis=1, keepdims=True)
    visible = (deep < 10.0) & (rng.random(deep.shape) > 0.1)
    W = np.where(visible[:, None], W + 0.2 * rng.normal(size=W.shape), np.nan)
    often = visible.sum(axis=0) >= 4
    solid = bundle_adjust(W, visible, camera, refine_focal=False)
    assert shape_error(solid.shape[:, often], shape[:, often]) < 0.04


@given(SEEDS, CAMERAS)
@settings(max_examples=4, deadline=None)
def test_a_shape_known_before_is_where_each_view_shows_it(rng: np.random.Generator, camera: Camera) -> None:
    """Of any size, turned anyhow, a tenth of its points unknown, on whichever side."""
    shape = ball(rng)
    W, placed = seen(np.repeat(shape[None], VIEWS, axis=0), round_about(300.0), camera, depth=1.2)
    visible = placed[:, 2] - placed[:, 2].mean(axis=1, keepdims=True) < 10.0
    W = W + 0.2 * rng.normal(size=W.shape) - camera.center_px[:, None]
    known = 1e-3 * round_about(100.0)[-1] @ shape
    known[:, ::10] = rng.normal(0, 0.1, known[:, ::10].shape)
    build = growth_from(W, visible, camera, likeness(W, visible), 7, flat=False).chosen
    right, posed = np.arange(shape.shape[1]) % 10 > 0, build.posed(known)
    for bundle, off in ((posed, 0.1 if camera.perspective else 0.01), (build.settled(posed, refine=False)[0], 0.01)):
        assert np.nanmax(np.nanmedian(build.residual(bundle)[:, right], axis=1)) < off  # affine at first


@pytest.mark.parametrize("seed", [5, pytest.param(8, marks=pytest.mark.slow)])
def test_a_box_that_is_seen_all_around_has_all_its_sides(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, v = (55 * np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 6)]))).reshape(2, -1)
    sides = [np.roll([u, v, np.full_like(u, away)], axis, axis=0) for axis in range(3) for away in (60.0, -60.0)]
    shape, outward = np.concatenate(sides, axis=1), np.repeat([side.mean(axis=1) for side in sides], len(u), axis=0).T
    angle = np.linspace(0, 2 * np.pi, 40)
    R = rotation_from_quaternion(quaternion_exp(np.column_stack([0.6 * np.sin(1.7 * angle + seed), angle, 0.3 * angle])))
    W, _ = seen(np.repeat(shape[None], 40, axis=0), R, PERSPECTIVE, depth=1.2)
    visible = (R @ outward)[:, 2] < -6.0
    solid = bundle_adjust(W + rng.normal(0, 0.2, W.shape), visible, PERSPECTIVE, refine_focal=False)
    often = visible.sum(axis=0) >= 4
    assert shape_error(solid.shape[:, often], shape[:, often]) < 0.02


def build(rng: np.random.Generator, camera: Camera, visible: np.ndarray) -> tuple[np.ndarray, Build]:
    """A hilly solid and its keyframes, in units of 100 px."""
    shape = relief(rng, visible.shape[1])
    W, _ = seen(np.repeat(shape[None], len(visible), axis=0), turns(len(visible)), camera)
    W = (W - camera.center_px[:, None]) / 100
    still, alike = np.zeros(len(W), np.int64), np.ones(len(W))
    return shape, Build(W, visible.astype(float), W[0], alike.astype(complex), alike, still, 100 / camera.focal_px, False)


@given(SEEDS, CAMERAS)
@settings(max_examples=3, deadline=None)
def test_a_view_that_shows_nothing_stays_with_the_one_it_is_built_on(rng: np.random.Generator, camera: Camera) -> None:
    visible = np.ones((VIEWS, 60), bool)
    visible[20] = False
    shape, views = build(rng, camera, visible)
    bundle = views.grown(RigidMotion(shape / 100, np.eye(3)[None], np.ones(1), np.zeros((1, 2))))
    assert np.isfinite(bundle.image()).all()
    assert shape_error(bundle.motion.shape, shape) < 0.01


@given(SEEDS, CAMERAS)
@settings(max_examples=5, deadline=None)
def test_all_views_are_factorised_either_way_round(rng: np.random.Generator, camera: Camera) -> None:
    visible = rng.random((VIEWS, 60)) > 0.1
    visible[2:, -1] = False  # no depth of its own
    shape, views = build(rng, camera, visible)
    found = views.factorized()
    assert len(found) == (2 if camera.perspective else 1)
    assert min(shape_error(one.motion.shape[:, :-1], shape[:, :-1]) for one in found) < 0.2  # there is perspective in it
    best, _ = min((views.settled(one, refine=False) for one in found), key=lambda one: one[1])
    assert shape_error(best.motion.shape[:, :-1], shape[:, :-1]) < 1e-3


def test_what_is_seen_too_seldom_is_not_factorised() -> None:
    visible = np.zeros((VIEWS, 60), bool)
    visible[np.arange(VIEWS)[:, None], 2 * np.arange(VIEWS)[:, None] + np.arange(3)] = True
    assert build(np.random.default_rng(0), ORTHOGRAPHIC, visible)[1].factorized() == []


@given(SEEDS, CAMERAS)
@settings(max_examples=5, deadline=None)
def test_new_points_are_located(rng: np.random.Generator, camera: Camera) -> None:
    visible = np.ones((VIEWS, 60), bool)
    visible[1:, 7] = False  # one view alone shows it
    _, views = build(rng, camera, visible)
    bundle, _ = min((views.settled(one, refine=False) for one in views.factorized()), key=lambda one: one[1])
    true, new = bundle.motion.shape.copy(), np.isin(np.arange(60), [7, 20, 40])
    lost = RigidMotion(np.where(new, 30.0, true), bundle.motion.R, bundle.motion.s, bundle.motion.t)
    found = located(views.W, views.h, type(bundle)(lost, bundle.kappa), new, flat=False)
    np.testing.assert_array_equal(found.motion.shape[:, ~new], true[:, ~new])
    np.testing.assert_allclose(found.motion.shape[:, [20, 40]], true[:, [20, 40]], atol=1e-3)
    np.testing.assert_allclose(found.image()[0][:, 7], views.W[0][:, 7], atol=1e-9)  # where it is seen, ...
    others = true[:, np.setdiff1d(np.arange(60), [7, 20, 40])]
    assert others[2].min() <= found.motion.shape[2, 7] <= others[2].max()  # ... as deep as what is beside it


def test_points_without_any_view_stay() -> None:
    visible = np.ones((VIEWS, 60), bool)
    visible[:, 3] = False
    _, views = build(np.random.default_rng(1), PERSPECTIVE, visible)
    bundle = views.factorized()[0]
    before = bundle.motion.shape[:, 3].copy()
    found = located(views.W, views.h, bundle, ~visible.any(axis=0), flat=False)
    np.testing.assert_array_equal(found.motion.shape[:, 3], before)


@given(SEEDS, CAMERAS)
@settings(max_examples=5, deadline=None)
def test_points_of_a_plane_are_located_on_it_by_one_view(rng: np.random.Generator, camera: Camera) -> None:
    still = flat(rng, 60)
    W, _ = seen(np.repeat(still[None], VIEWS, axis=0), turns(VIEWS), camera)
    visible = np.ones((VIEWS, 60), bool)
    visible[1:, 7] = False
    whole = bundle_adjust(W, np.ones_like(visible), camera, refine_focal=False, flat=True).motion
    new = np.isin(np.arange(60), [7, 20])
    lost = RigidMotion(np.where(new, 30.0, whole.shape), whole.R, whole.s, whole.t)
    W = W - camera.center_px[:, None]
    found = located(W, visible.astype(float), Bundle(lost, 1 / camera.focal_px), new, flat=True)
    np.testing.assert_allclose(found.motion.shape, whole.shape, atol=0.05)


@given(SEEDS, CAMERAS)
@settings(max_examples=5, deadline=None)
def test_a_view_that_is_stuck_is_posed_anew(rng: np.random.Generator, camera: Camera) -> None:
    shape, views = build(rng, camera, np.ones((VIEWS, 60), bool))
    known = RigidMotion(shape / 100, turns(VIEWS), np.ones(VIEWS), np.zeros((VIEWS, 2)))
    right, _ = views.adjusted(Bundle(known, views.kappa), Adjustment())
    m = right.motion
    R = m.R.copy()
    R[7] = R[7] @ np.diag([-1.0, 1.0, -1.0])
    stuck = Bundle(RigidMotion(m.shape, R, m.s, m.t), right.kappa)
    np.testing.assert_allclose(views.reposed(stuck).image(), views.W, atol=0.02)
