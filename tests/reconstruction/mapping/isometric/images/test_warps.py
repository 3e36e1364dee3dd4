"""Smooth maps between images: noise averaged out, gaps filled, gross errors told; the thin-plate field."""

import numpy as np
import pytest

from reconstruction import ReconstructionError
from reconstruction.mapping.isometric.images.reference import clearest_image, median, reference_image
from reconstruction.mapping.isometric.images.smooth_field import smooth_field
from reconstruction.mapping.isometric.images.warps import smooth_warps
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet


def test_smooth_images_are_nearer_to_the_truth_than_the_observations() -> None:
    W, S = waving_sheet(np.random.default_rng(1), points=250, amplitude=0.3, noise_px=0.5)
    warps = smooth_warps(W, np.ones((12, 250), bool))
    true = CAMERA.project(S)
    rms = [np.sqrt(((w - true) ** 2).mean()) for w in (W, warps.images())]
    assert rms[1] < 0.7 * rms[0]
    assert np.median(warps.noise_px) == pytest.approx(0.5, rel=0.25)


def test_as_many_functions_as_points_do_not_follow_the_noise() -> None:
    W, S = waving_sheet(np.random.default_rng(7), points=60, amplitude=0.2, noise_px=0.5)
    warps = smooth_warps(W, np.ones((12, 60), bool))
    assert warps.values.shape[1] == 60
    assert np.median(warps.noise_px) > 0.2  # of 0.5: an image that goes through its points says 0
    true = CAMERA.project(S)
    rms = [np.sqrt(((w - true) ** 2).mean()) for w in (W, warps.images())]
    assert rms[1] < 0.9 * rms[0]


def test_points_missing_in_the_reference_image_are_placed_by_the_others() -> None:
    rng = np.random.default_rng(2)
    W, _ = waving_sheet(rng, points=250, amplitude=0.3, noise_px=0.0)
    visible = rng.random((12, 250)) > 0.4
    W_seen = np.where(visible[:, None], W, np.nan)
    reference = reference_image(W_seen, visible)
    assert np.isfinite(reference).all()
    assert np.median(np.linalg.norm(reference - W[clearest_image(W_seen, visible)], axis=0)) < 2.0


@pytest.mark.parametrize(("points", "missing"), [(250, 0.75), (40, 0.3)])
def test_all_points_have_a_place_where_images_share_few(points: int, missing: float) -> None:
    rng = np.random.default_rng(6)
    W, _ = waving_sheet(rng, points=points, amplitude=0.3, noise_px=0.0)
    visible = rng.random((12, points)) > missing
    W_seen = np.where(visible[:, None], W, np.nan)
    assert ((visible[:, None] & visible).sum(axis=2)[~np.eye(12, dtype=bool)] < 40).all()
    reference = reference_image(W_seen, visible)
    seen = visible.any(axis=0)
    assert np.isfinite(reference[:, seen]).all()
    off = np.linalg.norm(reference - W[clearest_image(W_seen, visible)], axis=0)[seen]
    assert np.median(off) < 0.02 * np.ptp(W)


def test_an_image_of_the_surface_from_the_side_is_no_reference() -> None:
    W, _ = waving_sheet(np.random.default_rng(5), points=250, amplitude=0.3)
    first = W[0].copy()
    right = first[0] > np.median(first[0])
    first[0, right] = np.median(first[0]) - 0.3 * (first[0, right] - np.median(first[0]))  # folded over
    W = np.concatenate([first[None], W])
    visible = np.ones((13, 250), bool)
    assert clearest_image(W, visible) != 0
    warps = smooth_warps(W, visible)
    assert np.median(np.linalg.norm(warps.images() - W, axis=1)) < 1.0


@pytest.mark.filterwarnings("error")
def test_an_image_of_the_far_side_is_compared_with_none_of_the_near_one() -> None:
    W, _ = waving_sheet(np.random.default_rng(5), points=250, amplitude=0.3)
    near = np.arange(250) < 125
    visible = np.concatenate([np.tile(near, (6, 1)), np.tile(~near, (6, 1))])
    assert clearest_image(np.where(visible[:, None], W, np.nan), visible) < 6


def test_an_image_that_shows_hardly_anything_is_told() -> None:
    W, _ = waving_sheet(np.random.default_rng(3), points=120, amplitude=0.3, noise_px=0.0)
    visible = np.ones((12, 120), bool)
    visible[11, 2:] = False
    with pytest.raises(ReconstructionError, match="points that others show"):
        smooth_warps(np.where(visible[:, None], W, np.nan), visible)


def test_what_is_far_from_all_visible_points_is_uncertain() -> None:
    W, _ = waving_sheet(np.random.default_rng(3), points=200, amplitude=0.3)
    visible = np.ones((12, 200), bool)
    visible[4] = W[0, 0] < np.median(W[0, 0])
    warps = smooth_warps(np.where(visible[:, None], W, np.nan), visible)
    variance = warps.variance()[4]
    assert np.median(variance[~visible[4]]) > 10 * np.median(variance[visible[4]])


def test_field_reproduces_affine_functions_and_its_own_nodes() -> None:
    rng = np.random.default_rng(4)
    nodes = rng.uniform(0, 500, (2, 30))
    field = smooth_field(nodes, 30)
    B = field.at(nodes)
    assert np.linalg.matrix_rank(B) == 30
    np.testing.assert_allclose(B[:, 3:].T @ B[:, :3], 0, atol=1e-6)
    np.testing.assert_allclose((B[:, 3:] ** 2).mean(axis=0), 1, rtol=1e-6)


def test_nodes_on_top_of_each_other_do_not_spoil_the_field() -> None:
    nodes = np.random.default_rng(0).normal(0, 50, (2, 70))
    field = smooth_field(np.concatenate([nodes, nodes[:, :3]], axis=1), 110)
    assert np.abs(field.at(nodes)).max() < 100
    assert field.stiffness.max() < 1e6


def test_median_ignores_what_is_not_there() -> None:
    values = np.array([[1.0, np.nan, np.nan], [3.0, 2.0, np.nan], [2.0, 4.0, np.nan]])
    np.testing.assert_array_equal(median(values), [2.0, 3.0, np.nan])
