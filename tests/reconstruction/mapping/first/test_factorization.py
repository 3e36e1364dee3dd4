"""Rank-3 factorisation of rigid shapes: exact, with missing entries, with noise, and where it must refuse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction import ReconstructionError
from reconstruction.mapping.first.factorization import (
    affine_structure,
    factorize,
    metric_upgrade,
    rotations_from_rows,
    view_turn_degrees,
    weighted_solve,
)
from tests.reconstruction.world import ORTHOGRAPHIC, SEEDS, random_rotation, relief, seen, shape_error, turn, turns

FRAMES, POINTS = 12, 40


def views(rng: np.random.Generator, *, zoom: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Orthographic images (F, 2, p) px of a hilly surface that turns, and the surface."""
    shape = relief(rng, POINTS)
    R = turns(FRAMES) @ random_rotation(rng)
    s = 1 + 0.2 * rng.random(FRAMES) * zoom
    W, _ = seen(s[:, None, None] * np.broadcast_to(shape, (FRAMES, 3, POINTS)), R, ORTHOGRAPHIC)
    return W + 20 * rng.normal(size=(FRAMES, 2, 1)), R[0] @ shape


def hidden(rng: np.random.Generator, share: float) -> np.ndarray:
    return rng.random((FRAMES, POINTS)) >= share


@settings(max_examples=15)
@given(rng=SEEDS)
def test_a_rigid_shape_is_recovered_exactly(rng: np.random.Generator) -> None:
    W, shape = views(rng)
    result = factorize(W, np.ones((FRAMES, POINTS), bool))
    assert shape_error(result.motion.shape, shape) < 1e-5
    assert result.rms_px < 1e-4
    assert result.singular_values[3] < 1e-6 * result.singular_values[2]
    assert result.metric_condition > 0
    np.testing.assert_allclose(result.motion.R[0], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(result.motion.shape.mean(axis=1), 0, atol=1e-9)
    seen_again = (result.motion.s[:, None, None] * result.motion.R @ result.motion.shape)[:, :2]
    np.testing.assert_allclose(seen_again + result.motion.t[:, :, None], W, atol=0.01)


@settings(max_examples=15)
@given(rng=SEEDS)
def test_missing_entries_do_not_matter(rng: np.random.Generator) -> None:
    W, shape = views(rng)
    visible = hidden(rng, 0.3)
    result = factorize(np.where(visible[:, None], W, np.nan), visible)
    assert shape_error(result.motion.shape, shape) < 0.02
    assert result.rms_px < 0.2


@settings(max_examples=15)
@given(rng=SEEDS, share=st.sampled_from([0.0, 0.3]))
def test_noise_costs_little(rng: np.random.Generator, share: float) -> None:
    W, shape = views(rng)
    visible = hidden(rng, share)
    result = factorize(W + rng.normal(0, 0.3, W.shape), visible)
    assert shape_error(result.motion.shape, shape) < 0.08
    assert 0.1 < result.rms_px < 0.6
    assert result.singular_values[2] > 5 * result.singular_values[3]


@settings(max_examples=10)
@given(rng=SEEDS)
def test_scale_of_the_image_is_the_scale_of_the_shape(rng: np.random.Generator) -> None:
    W, _ = views(rng)
    visible = hidden(rng, 0.2)
    one, two = factorize(W, visible), factorize(2 * W + 7, visible)
    assert shape_error(two.motion.shape, one.motion.shape) < 1e-4
    assert np.linalg.norm(two.motion.shape) == pytest.approx(2 * np.linalg.norm(one.motion.shape), rel=1e-4)


@settings(max_examples=15)
@given(rng=SEEDS)
def test_upgrade_makes_rows_orthogonal_and_equally_long(rng: np.random.Generator) -> None:
    R = turns(FRAMES)
    distortion = rng.normal(size=(3, 3)) + 3 * np.eye(3)
    Q, condition = metric_upgrade(R[:, :2] @ distortion)
    A = R[:, :2] @ distortion @ Q
    gram = A @ A.transpose(0, 2, 1)
    gram = gram / gram[0, 0, 0]
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(2), gram.shape), atol=1e-6)
    assert 0 < condition <= 1


def test_views_no_camera_explains_are_told_apart() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(FRAMES, 2, 3)) * [[[1.0], [8.0]]]  # images ever differently stretched
    Q, condition = metric_upgrade(A)
    assert condition < 0.05
    assert np.isfinite(Q).all()


@given(SEEDS)
def test_rows_are_completed_to_the_nearest_rotations(rng: np.random.Generator) -> None:
    R = np.stack([random_rotation(rng) for _ in range(4)])
    np.testing.assert_allclose(rotations_from_rows(3.0 * R[:, :2]), R, atol=1e-9)


def test_turn_counts_viewing_directions_only() -> None:
    assert view_turn_degrees(np.stack([np.eye(3), turn((0, 0, 80))])) == pytest.approx(0, abs=1e-4)
    assert view_turn_degrees(np.stack([np.eye(3), turn((0, 30, 0)), turn((0, -15, 0))])) == pytest.approx(45)


@given(SEEDS)
def test_affine_structure_explains_its_observations(rng: np.random.Generator) -> None:
    W, _ = views(rng, zoom=True)
    A, t, S = affine_structure(W, np.ones((FRAMES, POINTS), bool))
    np.testing.assert_allclose(A @ S + t[:, :, None], W, atol=1e-3)
    np.testing.assert_allclose(S.mean(axis=1), 0, atol=1e-9)


@given(SEEDS)
def test_weighted_solve_is_a_solve(rng: np.random.Generator) -> None:
    J = rng.normal(size=(3, 9, 4))
    gram, right = J.transpose(0, 2, 1) @ J, rng.normal(size=(3, 2, 4))
    solution = weighted_solve(gram, right)
    np.testing.assert_allclose(solution @ gram, right, rtol=1e-4, atol=1e-5)


def unseen_frame(visible: np.ndarray) -> None:
    visible[3, 3:] = False


def unseen_point(visible: np.ndarray) -> None:
    visible[1:, 5] = False


@pytest.mark.parametrize("hide", [unseen_frame, unseen_point])
def test_entries_too_rare_are_refused(hide) -> None:  # type: ignore[no-untyped-def]
    W, _ = views(np.random.default_rng(1))
    visible = np.ones((FRAMES, POINTS), bool)
    hide(visible)
    with pytest.raises(ReconstructionError, match="every frame needs 4 visible points and every point 2 frames"):
        factorize(W, visible)


@pytest.mark.parametrize(("frames", "points"), [(2, 40), (12, 3)])
def test_too_little_to_factorise_is_refused(frames: int, points: int) -> None:
    W, _ = views(np.random.default_rng(1))
    with pytest.raises(ReconstructionError, match=f"cannot factorise {frames} frames of {points} points"):
        factorize(W[:frames, :, :points], np.ones((frames, points), bool))
