from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction import ReconstructionError
from reconstruction.camera import Camera
from reconstruction.evaluation import with_missing, with_outliers
from reconstruction.mapping.solid.placing import MOST_POINTS, well_spread
from reconstruction.mapping.solid.solid import bundle_adjust
from tests.reconstruction.world import CAMERAS, PERSPECTIVE, SEEDS, flat, relief, seen, shape_error, turns

KEYFRAMES, POINTS = 14, 120


def views(rng: np.random.Generator, camera: Camera, degrees: float = 25.0, noise: float = 0.2):
    """A hilly solid, its keyframes' points and their visibility."""
    shape = relief(rng, POINTS)
    W, _ = seen(np.repeat(shape[None], KEYFRAMES, axis=0), turns(KEYFRAMES, degrees), camera)
    return shape, W + noise * rng.normal(size=W.shape), np.ones((KEYFRAMES, POINTS), bool)


@given(SEEDS, CAMERAS)
@settings(max_examples=4, deadline=None)
def test_shape_comes_back(rng, camera):
    shape, W, visible = views(rng, camera)
    solid = bundle_adjust(W, visible, camera)
    assert shape_error(solid.shape, shape) < 0.012
    assert np.nanmedian(solid.residual_px, axis=1).max() < 0.5
    assert solid.trusted.mean() > 0.95


@given(SEEDS, CAMERAS)
@settings(max_examples=4, deadline=None)
def test_missing_points_and_outliers(rng, camera):
    shape, W, visible = views(rng, camera, noise=0.5)
    visible = with_missing(visible, 0.4, rng)
    W = np.where(visible[:, None], with_outliers(W, visible, 0.1, rng), np.nan)
    solid = bundle_adjust(W, visible, camera)
    assert shape_error(solid.shape[:, solid.trusted], shape[:, solid.trusted]) < 0.05


@given(SEEDS, CAMERAS, st.sampled_from([1e-3, 1e3]))
@settings(max_examples=2, deadline=None)
def test_units_do_not_matter(rng, camera, factor):
    _, W, visible = views(rng, camera)
    other = Camera(camera.focal_px * factor, camera.center_px * factor)
    a, b = bundle_adjust(W, visible, camera), bundle_adjust(W * factor, visible, other)
    np.testing.assert_allclose(b.shape, factor * a.shape, rtol=1e-5, atol=1e-5 * factor)
    np.testing.assert_array_equal(a.trusted, b.trusted)


@given(SEEDS)
@settings(max_examples=4, deadline=None)
def test_mirrored_picture_gives_the_mirrored_shape(rng):
    shape, W, visible = views(rng, PERSPECTIVE)
    centre = PERSPECTIVE.center_px[0]
    flipped = W.copy()
    flipped[:, 0] = 2 * centre - W[:, 0]
    solid = bundle_adjust(flipped, visible, PERSPECTIVE)
    assert shape_error(solid.shape * np.array([[-1.0], [1.0], [1.0]]), shape) < 0.012


def test_perspective_tells_which_way_it_bulges():
    shape, W, visible = views(np.random.default_rng(1), PERSPECTIVE)
    solid = bundle_adjust(W, visible, PERSPECTIVE)
    assert np.corrcoef(solid.shape[2], shape[2])[0, 1] > 0.99


@pytest.mark.parametrize("seed", [0, 2])
@pytest.mark.parametrize(("side", "swell"), [(1, 0.0), (-1, 0.0), (1, 0.1)], ids=["dome", "dish", "swelling dome"])
def test_things_are_seen_from_outside_where_views_hardly_tell(seed, side, swell):
    rng = np.random.default_rng(seed)
    x, y, _ = flat(rng, 120)
    shape = np.stack([x, y, side * (x * x + y * y) / 400])
    change = swell * rng.normal(size=(12, 3, 1)) * np.sin(x / 20 + rng.uniform(0, 6, (12, 1, 1)))
    R = turns(12, 6.0)
    W = seen(shape * (1 + change), R, PERSPECTIVE)[0] + 0.2 * rng.normal(size=(12, 2, 120))
    found = bundle_adjust(W, np.ones((12, 120), bool), PERSPECTIVE, refine_focal=False)
    assert np.corrcoef((found.motion.R[0] @ found.shape)[2], shape[2])[0, 1] > 0.5


def test_focal_length_is_refined_where_the_views_hold_it():
    shape, W, visible = views(np.random.default_rng(5), PERSPECTIVE, degrees=35)
    rough = replace(PERSPECTIVE, focal_px=1.4 * PERSPECTIVE.focal_px)
    free, held = (bundle_adjust(W, visible, rough, refine_focal=refine) for refine in (True, False))
    assert abs(free.camera.focal_px / PERSPECTIVE.focal_px - 1) < 0.1
    assert held.camera.focal_px == pytest.approx(rough.focal_px)
    assert shape_error(free.shape, shape) < shape_error(held.shape, shape)


def test_a_still_object_has_no_deep_relief():
    _, W, visible = views(np.random.default_rng(2), PERSPECTIVE, degrees=0.0, noise=0.5)
    solid = bundle_adjust(W, visible, PERSPECTIVE)
    assert solid.relief < 0.6
    assert "hardly turned" in solid.note


def test_a_plane_stays_one_if_asked():
    _, W, visible = views(np.random.default_rng(2), PERSPECTIVE)
    assert bundle_adjust(W, visible, PERSPECTIVE, flat=True).relief < 0.01


@pytest.mark.parametrize("seed", range(4, 8))
def test_a_plane_is_found_though_points_that_come_late_are_not_on_it(seed):
    rng = np.random.default_rng(seed)
    W, _ = seen(np.repeat(flat(rng, POINTS)[None], 24, axis=0), turns(24, 4.0), PERSPECTIVE)
    W += 0.5 * rng.normal(size=W.shape)
    visible, late = np.ones((24, POINTS), bool), rng.choice(POINTS, POINTS // 4, replace=False)
    visible[:16, late] = False
    W[16:, :, late] += 40 * rng.normal(size=(2, len(late))) * np.linspace(-1, 1, 8)[:, None, None]
    found = bundle_adjust(W, visible, PERSPECTIVE, refine_focal=False, flat=True)
    assert found.relief < 0.01
    assert np.nanmedian(found.residual_px, axis=1).max() < 1.0


def test_large_turns_come_back_from_views_out_of_order():
    rng = np.random.default_rng(4)
    shape, W, visible = views(rng, PERSPECTIVE, degrees=50)
    order = rng.permutation(KEYFRAMES)
    assert shape_error(bundle_adjust(W[order], visible, PERSPECTIVE).shape, shape) < 0.012


@given(SEEDS, CAMERAS)
@settings(max_examples=2, deadline=None)
def test_of_dense_points_those_placed_afterwards_are_as_good(rng, camera):
    points = MOST_POINTS + 500
    shape = relief(rng, points)
    W, _ = seen(np.repeat(shape[None], KEYFRAMES, axis=0), turns(KEYFRAMES), camera)
    visible = with_missing(np.ones((KEYFRAMES, points), bool), 0.3, rng)
    W = np.where(visible[:, None], with_outliers(W + 0.2 * rng.normal(size=W.shape), visible, 0.05, rng), np.nan)
    solid = bundle_adjust(W, visible, camera)
    apart = np.setdiff1d(np.arange(points), well_spread(shape[:2], visible))
    assert len(apart) == 500
    assert shape_error(solid.shape[:, apart], shape[:, apart]) < 0.02


def test_too_few_views_or_points_say_so():
    _, W, visible = views(np.random.default_rng(0), PERSPECTIVE)
    with pytest.raises(ReconstructionError, match="3 keyframes"):
        bundle_adjust(W[:2], visible[:2], PERSPECTIVE)
    with pytest.raises(ReconstructionError, match="6 points"):
        bundle_adjust(W[:, :, :5], visible[:, :5], PERSPECTIVE)
