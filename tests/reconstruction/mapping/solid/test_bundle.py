from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.mapping.solid.adjustment import Adjustment, System, adjust, energy
from reconstruction.mapping.solid.bundle import FARTHEST, Bundle, Derivatives, Loss, Prior, beyond_all, off_plane, scaled
from tests.reconstruction.world import SEEDS, random_rotation

FREE = Prior(depth=0.0, apart=0.0, focal=1.0, kappa=0.2)


def some(rng: np.random.Generator, K: int = 3, p: int = 7, kappa: float = 0.2) -> Bundle:
    R = np.stack([random_rotation(rng) for _ in range(K)])
    return Bundle(RigidMotion(rng.normal(size=(3, p)), R, rng.uniform(0.8, 1.2, K), rng.normal(size=(K, 2))), kappa)


@given(SEEDS, st.sampled_from([0.0, 0.15]))
@settings(deadline=None)
def test_derivatives_agree_with_differences(rng, kappa):
    bundle, step = some(rng, kappa=kappa), 1e-6
    K, p = 3, 7
    of = Derivatives(bundle)
    poses, points = rng.normal(size=(K, 6)), rng.normal(size=(3, p))
    analytic = np.einsum("kacp,ka->kcp", of.by_pose, poses) + of.by_log_kappa
    analytic += np.einsum("kdcp,dp->kcp", of.by_point, points)
    ahead, behind = (bundle.moved(h * poses, h, h * points).image() for h in (step, -step))
    np.testing.assert_allclose(analytic, (ahead - behind) / (2 * step), rtol=1e-5, atol=1e-6 * np.abs(analytic).max())


@given(SEEDS, st.booleans(), st.sampled_from([0.0, 3.0]))
@settings(deadline=None)
def test_right_hand_side_is_minus_the_gradient(rng, redescending, depth):
    bundle, step = some(rng, kappa=0.1), 1e-6
    W = bundle.image() + 0.3 * rng.normal(size=(3, 2, 7))
    h, loss, prior = (rng.random((3, 7)) > 0.2).astype(float), Loss(0.5, redescending), Prior(depth, 0.0, 2.0, 0.15)
    system = System(W, h, bundle, loss, prior)
    poses, points = rng.normal(size=(3, 6)), rng.normal(size=(3, 7))
    poses[0, [0, 1, 2, 5]] = 0  # the first view's turn and scale are held
    slope = -(system.right_views[:-1] @ poses.ravel() + system.right_views[-1] + (system.right_points * points).sum())
    ahead, behind = (energy(W, h, bundle.moved(e * poses, e, e * points), loss, prior) for e in (step, -step))
    np.testing.assert_allclose((ahead - behind) / (2 * step), slope, rtol=1e-4, atol=1e-6)


@given(SEEDS)
@settings(deadline=None)
def test_a_step_solves_the_whole_system(rng):
    bundle = some(rng, K=4, p=9, kappa=0.1)
    W = bundle.image() + 0.1 * rng.normal(size=(4, 2, 9))
    system = System(W, np.ones((4, 9)), bundle, Loss(1.0, redescending=False), FREE)
    poses, log_kappa, points = system.step(0.1)
    n = len(system.right_views)
    whole = np.zeros((n + 27, n + 27))
    whole[:n, :n] = system.views
    whole[:n, n:] = system.between.transpose(0, 2, 1).reshape(n, 27)
    whole[n:, :n] = whole[:n, n:].T
    for i, block in enumerate(system.points.transpose(2, 0, 1)):
        whole[n + 3 * i : n + 3 * i + 3, n + 3 * i : n + 3 * i + 3] = block
    whole[np.diag_indices(len(whole))] *= 1.1
    expected = np.linalg.solve(whole, np.r_[system.right_views, system.right_points.T.ravel()])
    np.testing.assert_allclose(np.r_[poses.ravel(), log_kappa, points.T.ravel()], expected, rtol=1e-5, atol=1e-7)


@given(SEEDS, st.floats(1e-3, 1e3))
@settings(deadline=None)
def test_image_scales_with_the_unit(rng, factor):
    bundle = some(rng, kappa=0.1)
    np.testing.assert_allclose(scaled(bundle, factor).image(), factor * bundle.image(), rtol=1e-9)


@given(SEEDS)
def test_distance_from_the_plane_does_not_see_a_slope(rng):
    shape = rng.normal(size=(3, 12))
    leaning = shape + np.array([[0.0], [0.0], [1.0]]) * (2 * shape[0] - shape[1] + 3)
    np.testing.assert_allclose(off_plane(leaning, 0.0)[0], off_plane(shape, 0.0)[0], atol=1e-9)


@given(SEEDS)
@settings(deadline=None)
def test_what_is_nearer_and_smaller_alike_looks_the_same_and_gains_nothing(rng):
    bundle, prior = some(rng, kappa=0.1), Prior(3.0, 2.0, np.inf, 0.1)
    axes = replace(bundle, motion=bundle.motion.in_first_frame())
    axes.motion.shape[:2, 0] += 4 * FARTHEST
    camera = np.array([*axes.motion.t[0], 1 / axes.kappa])[:, None]  # where it is from the shape's origin
    shape = 0.3 * (axes.motion.shape + camera) - camera
    near = replace(axes, motion=replace(axes.motion, shape=shape))
    np.testing.assert_allclose(near.image()[0], axes.image()[0], atol=1e-9)
    assert prior.value(near) == pytest.approx(prior.value(axes))


@given(SEEDS)
@settings(deadline=None)
def test_a_point_far_from_the_rest_is_drawn_back(rng):
    bundle, prior, step = some(rng, p=12, kappa=0.1), Prior(0.0, 2.0, np.inf, 0.1), 1e-6
    np.testing.assert_array_equal(beyond_all(bundle.motion.shape.clip(-1, 1), 0.1)[0], 0)
    bundle.motion.shape[:, 0] = 4 * FARTHEST  # never in the middle
    system = System(bundle.image(), np.ones((3, 12)), bundle, Loss(1.0, redescending=False), prior)
    way = np.zeros((3, 12))
    way[:, 0] = rng.normal(size=3)
    ahead, behind = (prior.value(bundle.moved(np.zeros((3, 6)), 0.0, e * way)) for e in (step, -step))
    slope = -(system.right_points * way).sum()
    assert (ahead - behind) / (2 * step) == pytest.approx(slope, rel=1e-4, abs=1e-6)
    assert system.right_points[2, 0] < 0


@given(SEEDS, st.sampled_from([0.0, 0.1]))
@settings(deadline=None)
def test_the_middle_may_be_anywhere(rng, kappa):
    bundle = some(rng, kappa=kappa)
    m = bundle.motion
    off = rng.normal(size=3)
    elsewhere = replace(bundle, motion=replace(m, shape=m.shape + off[:, None]))
    centred = elsewhere.centred()
    np.testing.assert_allclose(centred.image(), elsewhere.image(), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.median(centred.motion.shape, axis=1), 0, atol=1e-9)
    assert centred.motion.s[0] == 1


def test_losses_agree_with_the_parabola_near_zero_and_not_far_out():
    for redescending in (True, False):
        loss = Loss(2.0, redescending)
        np.testing.assert_allclose(loss.value(np.array([1e-6])), 0.5e-6, rtol=1e-5)
        assert loss.weight(np.array([400.0])) < 0.11


def test_adjusting_never_makes_it_worse():
    rng = np.random.default_rng(3)
    bundle = some(rng, K=5, p=20, kappa=0.05)
    W = bundle.image() + 0.2 * rng.normal(size=(5, 2, 20))
    h, loss = np.ones((5, 20)), Loss(1.0, redescending=True)
    before = energy(W, h, bundle, loss, FREE)
    for points in (True, False):
        after, value = adjust(W, h, bundle, loss, FREE, Adjustment(points=points))
        assert value < before
        assert (after.motion.shape != bundle.motion.shape).any() == points
        np.testing.assert_allclose(after.motion.R[0], bundle.motion.R[0], atol=1e-12)


def test_points_that_are_not_seen_may_be_anywhere_those_that_are_may_not() -> None:
    bundle = some(np.random.default_rng(2), kappa=0.3)
    behind = bundle.motion.shape.copy()
    behind[:, 0] = -20.0 * bundle.motion.R[0, 2]  # behind the first camera
    bundle = Bundle(replace(bundle.motion, shape=behind), 0.3)
    W, h = bundle.image(), np.ones((3, 7))
    assert energy(W, h, bundle, Loss(1.0, False), FREE) == np.inf
    h[:, 0] = 0.0
    assert np.isfinite(energy(W, h, bundle, Loss(1.0, False), FREE))
    assert np.isfinite(Derivatives(bundle).by_pose).all()


def test_no_view_shrinks_to_a_point() -> None:
    bundle = some(np.random.default_rng(3), kappa=0.0)
    W, h = bundle.image(), np.ones((3, 7))
    small = Bundle(replace(bundle.motion, s=bundle.motion.s * [1.0, 1e-3, 1.0]), 0.0)
    assert energy(W, h, small, Loss(1.0, False), FREE) == np.inf
