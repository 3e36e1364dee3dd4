"""Scores against ground truth, noise, missing data, and truth points followed in the mesh."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction import ReconstructionError
from reconstruction.basis.mesh import triangulate
from reconstruction.evaluation import MIRROR, e3d, followed, score, with_missing, with_noise, with_outliers
from tests.reconstruction.world import SEEDS, random_rotation, relief, turn

FRAMES, POINTS = 4, 20


def truth_of(rng: np.random.Generator) -> np.ndarray:
    return np.stack([relief(rng, POINTS) for _ in range(FRAMES)])


@given(SEEDS, st.floats(0.1, 10), st.booleans())
def test_place_scale_depth_sign_and_orientation_are_no_error(rng, scale: float, mirrored: bool) -> None:  # type: ignore[no-untyped-def]
    truth = truth_of(rng)
    moved = scale * (MIRROR @ truth if mirrored else truth) + rng.normal(size=(FRAMES, 3, 1))
    np.testing.assert_allclose(e3d(moved, truth, turned=False), 0, atol=1e-9)
    turned = np.stack([random_rotation(rng) for _ in range(FRAMES)]) @ moved
    np.testing.assert_allclose(e3d(turned, truth), 0, atol=1e-7)


def test_points_whose_truth_is_not_known_are_not_scored() -> None:
    rng = np.random.default_rng(0)
    truth = truth_of(rng)
    shapes = truth + 0.1 * rng.normal(size=truth.shape)
    sigma, frames = np.full((FRAMES, POINTS), 0.1), np.arange(FRAMES)
    wild = shapes.copy()
    wild[:, :, 15:] += 100
    unknown = np.where(np.arange(POINTS) >= 15, np.nan, truth)
    some = score(shapes[:, :, :15], truth[0, :, :15], truth[:, :, :15], frames, sigma[:, :15])
    ours = score(wild, truth[0], unknown, frames, sigma)
    np.testing.assert_allclose(ours.per_frame, some.per_frame)
    assert (ours.points, ours.error_over_sigma) == (15, pytest.approx(some.error_over_sigma))
    unknown[2, 1, 3] = np.nan  # of one frame alone
    changed = e3d(wild, unknown)
    assert np.isfinite(changed).all()
    assert changed[2] != pytest.approx(ours.per_frame[2], rel=1e-4)


def test_a_wrong_pose_counts_only_for_the_camera() -> None:
    rng = np.random.default_rng(0)
    truth = truth_of(rng)
    wrong = np.concatenate([truth[:2], turn((0, 20, 0)) @ truth[2:]])
    result = score(wrong, truth[0], truth, np.arange(FRAMES))
    assert result.e3d < 1e-6
    assert 0.1 < result.e3d_camera < 0.5


def test_one_scale_and_one_sign_for_all_frames() -> None:
    rng = np.random.default_rng(0)
    truth = truth_of(rng)
    assert e3d(truth * np.array([1.0, 1.0, 1.0, 1.2])[:, None, None], truth).max() > 0.02
    assert e3d(np.concatenate([truth[:3], MIRROR @ truth[3:]]), truth, turned=False)[3] > 0.1


@given(SEEDS)
def test_each_frame_may_have_its_own_depth_sign(rng: np.random.Generator) -> None:
    truth = truth_of(rng)
    shapes = truth + 0.1 * rng.normal(size=truth.shape)
    halved = np.concatenate([shapes[:2], MIRROR @ shapes[2:]])
    free = e3d(halved, truth, sign_free=True)
    np.testing.assert_allclose(free, e3d(shapes, truth), rtol=1e-9)
    assert score(halved, truth[0], truth, np.arange(FRAMES)).e3d_sign_free == pytest.approx(free.mean())
    # One sign for all leaves two frames on the wrong branch; and no other choice of signs is better.
    assert e3d(halved, truth).mean() > free.mean() + 0.05
    for signs in itertools.product((np.eye(3), MIRROR), repeat=FRAMES):
        assert free.mean() <= e3d(np.stack(signs) @ halved, truth).mean() + 1e-9


@given(SEEDS)
def test_error_is_the_relative_distance(rng: np.random.Generator) -> None:
    truth = truth_of(rng)
    shapes = truth + rng.normal(size=truth.shape)
    S = shapes - shapes.mean(axis=2, keepdims=True)
    aligned = []
    for a, b in zip(S, truth, strict=True):  # Kabsch, written down once more
        U, _, Vt = np.linalg.svd(b @ a.T)
        aligned.append(U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt @ a)
    stacked = np.stack(aligned)
    stacked *= (stacked * truth).sum() / (stacked**2).sum()
    expected = [np.linalg.norm(a - b) / np.linalg.norm(b) for a, b in zip(stacked, truth, strict=True)]
    np.testing.assert_allclose(e3d(shapes, truth), expected, rtol=1e-6)


@given(SEEDS)
def test_score_names_what_was_scored(rng: np.random.Generator) -> None:
    truth = truth_of(rng)
    result = score(truth, truth[0], truth, np.array([3, 5, 8, 9]))
    assert result.points == POINTS
    assert result.frames.tolist() == [3, 5, 8, 9]
    assert result.per_frame.shape == (FRAMES,)
    assert result.e3d == pytest.approx(result.per_frame.mean())
    still = np.broadcast_to(truth[0], truth.shape)
    assert result.e3d_static == pytest.approx(e3d(still, truth).mean())
    assert result.e3d_static > 0.01


def test_depth_set_to_zero_is_a_bad_answer_on_a_solid() -> None:
    truth = truth_of(np.random.default_rng(0))
    assert e3d(truth * np.array([[1.0], [1.0], [0.0]]), truth).mean() > 0.1


@given(SEEDS)
def test_truth_points_are_followed_where_their_triangle_goes(rng: np.random.Generator) -> None:
    rest = relief(rng, POINTS)
    mesh = triangulate(rest[:2].T)
    shapes = [rest, rest + rng.normal(size=rest.shape)]
    weights = rng.dirichlet(np.ones(3), 8)
    corners = mesh.faces[rng.integers(len(mesh.faces), size=8)]
    truth_px = np.einsum("dnk,nk->nd", rest[:2][:, corners], weights)
    outside = np.array([[1e4, 0.0], [0.0, -1e4]])
    points, still, inside = followed(shapes, [s[:2].T for s in shapes], rest, mesh, np.concatenate([truth_px, outside]))
    assert inside.tolist() == [True] * 8 + [False] * 2
    assert points.shape == (2, 3, 8)
    for found, shape in ((points[0], rest), (points[1], shapes[1]), (still, rest)):
        np.testing.assert_allclose(found, np.einsum("dnk,nk->dn", shape[:, corners], weights), atol=1e-6)


def test_truth_outside_the_mesh_is_said() -> None:
    rest = relief(np.random.default_rng(0), POINTS)
    with pytest.raises(ReconstructionError, match=r"fewer than 3 truth points lie inside the mesh"):
        followed([rest], [rest[:2].T], rest, triangulate(rest[:2].T), np.full((5, 2), 1e4))


def test_noise_has_the_papers_size_and_its_seed() -> None:
    W = 100 * np.random.default_rng(0).normal(size=(50, 2, 200)) + 300
    noisy = with_noise(W, 0.01, np.random.default_rng(7))
    centred = W - W.mean(axis=2, keepdims=True)
    expected = 0.01 * np.linalg.norm(centred, axis=1).max()
    assert (noisy - W).std() == pytest.approx(expected, rel=0.03)
    np.testing.assert_array_equal(noisy, with_noise(W, 0.01, np.random.default_rng(7)))
    np.testing.assert_array_equal(with_noise(W, 0.0, np.random.default_rng(7)), W)


def test_noise_ignores_entries_that_are_not_there() -> None:
    W = np.random.default_rng(0).normal(size=(5, 2, 30))
    W[2, :, 4] = np.nan
    noisy = with_noise(W, 0.01, np.random.default_rng(1))
    np.testing.assert_array_equal(np.isnan(noisy), np.isnan(W))


def test_missing_entries_are_a_share_drawn_by_the_seed() -> None:
    visible = np.random.default_rng(0).random((100, 200)) < 0.9
    left = with_missing(visible, 0.4, np.random.default_rng(3))
    assert (left <= visible).all()
    assert left.sum() / visible.sum() == pytest.approx(0.6, abs=0.01)
    np.testing.assert_array_equal(left, with_missing(visible, 0.4, np.random.default_rng(3)))
    assert (left != with_missing(visible, 0.4, np.random.default_rng(4))).any()
    np.testing.assert_array_equal(with_missing(visible, 0.0, np.random.default_rng(3)), visible)


def test_outliers_are_a_share_drawn_by_the_seed_and_lie_among_the_points() -> None:
    rng = np.random.default_rng(0)
    W, visible = rng.normal(100.0, 10.0, (100, 2, 200)), rng.random((100, 200)) < 0.9
    wild = with_outliers(np.where(visible[:, None], W, np.nan), visible, 0.1, np.random.default_rng(3))
    moved = visible & (wild != W).any(axis=1)
    assert moved.sum() / visible.sum() == pytest.approx(0.1, abs=0.01)
    assert np.isnan(wild[:, 0][~visible]).all()
    assert wild[:, 0][moved].min() >= W[:, 0][visible].min()
    assert wild[:, 0][moved].max() <= W[:, 0][visible].max()
    np.testing.assert_array_equal(with_outliers(W, visible, 0.0, np.random.default_rng(3)), W)
    assert with_outliers(W, np.zeros_like(visible), 0.5, np.random.default_rng(3)) is W
