"""Sums that stand for the points: against the direct sum of residuals, for both cameras."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.window import statistics
from reconstruction.window.statistics import Statistics, frame_statistics, stack
from tests.reconstruction.world import SEEDS

FOCAL = st.sampled_from([np.inf, 0.8, 3.0, 40.0])


def scene(rng: np.random.Generator, p: int = 30, r: int = 4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Basis (4 + r, p), image points (2, p) and M (1, 3, 4 + r), nothing special about any."""
    basis = np.concatenate([rng.normal(size=(3 + r, p)), np.ones((1, p))])
    M = rng.normal(size=(1, 3, 4 + r))
    M[:, 2, -1] = 0.0  # the third row of a translation in the image
    return basis, rng.normal(size=(2, p)), M


def weights_of(rng: np.random.Generator, p: int) -> np.ndarray:
    """A random mask, or random weights of which some are zero."""
    mask = rng.random(p) < rng.random()
    return np.where(mask, rng.random(p) if rng.random() < 0.5 else 1.0, 0.0)


def gradient(data: statistics.Statistics, M: np.ndarray) -> np.ndarray:
    """Half the derivative (n, 3, K) of the data terms with respect to M (n, 3, K)."""
    return statistics.apply(data, M[:, None])[:, 0] - data.linear


@given(SEEDS, FOCAL)
def test_value_is_the_direct_sum_of_residuals(rng: np.random.Generator, focal: float) -> None:
    basis, W, M = scene(rng)
    h = weights_of(rng, W.shape[1])
    direct = (h * (statistics.residuals(basis, W, M[0], focal) ** 2).sum(axis=0)).sum() / W.shape[1]
    data = frame_statistics(basis, W, h, focal)
    assert statistics.value(data, M)[0] == pytest.approx(direct, rel=1e-9, abs=1e-12)


@given(SEEDS, FOCAL)
def test_many_frames_at_once_have_the_statistics_of_each(rng: np.random.Generator, focal: float) -> None:
    basis, W, _ = scene(rng)
    frames = np.stack([W, W + rng.normal(size=W.shape), -W])
    h = np.stack([weights_of(rng, W.shape[1]) for _ in frames])
    at_once = statistics.statistics_of_frames(basis, frames, h, focal)
    products = statistics.Products(np.concatenate([rng.normal(size=(3, W.shape[1])), basis[3:]]))
    products.change_rest(basis)
    in_parts = statistics.stack(list(products.statistics(frames, h, focal, 2)))
    each = statistics.stack([frame_statistics(basis, w, seen, focal) for w, seen in zip(frames, h, strict=True)])
    for ours in (at_once, in_parts):
        np.testing.assert_allclose(ours.gram, each.gram, atol=1e-9)
        np.testing.assert_allclose(ours.cross, each.cross, atol=1e-9)
        np.testing.assert_allclose(ours.power, each.power, atol=1e-9)


@given(SEEDS, FOCAL)
def test_residual_is_the_reprojection_error_times_depth(rng: np.random.Generator, focal: float) -> None:
    basis, W, M = scene(rng)
    M *= 0.1 if np.isfinite(focal) else 1.0  # everything in front of the camera
    at = M[0] @ basis
    depth = 1 + at[2] / focal
    expected = (W - at[:2] / depth) * depth
    np.testing.assert_allclose(statistics.residuals(basis, W, M[0], focal), expected, atol=1e-10)


@given(SEEDS)
def test_far_away_cameras_are_orthographic(rng: np.random.Generator) -> None:
    basis, W, M = scene(rng)
    h = weights_of(rng, W.shape[1])
    far, orthographic = (frame_statistics(basis, W, h, focal) for focal in (1e9, np.inf))
    assert statistics.value(far, M)[0] == pytest.approx(statistics.value(orthographic, M)[0], rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(gradient(far, M), gradient(orthographic, M), atol=1e-6)
    direct = (h * ((W - M[0, :2] @ basis) ** 2).sum(axis=0)).sum() / W.shape[1]  # Eq. 8
    assert statistics.value(orthographic, M)[0] == pytest.approx(direct, rel=1e-9, abs=1e-12)


@given(SEEDS, FOCAL)
def test_gradient_is_half_the_derivative(rng: np.random.Generator, focal: float) -> None:
    basis, W, M = scene(rng, p=15, r=2)
    data = frame_statistics(basis, W, weights_of(rng, 15), focal)
    slope = gradient(data, M)[0]
    for c, k in np.ndindex(slope.shape):
        step = np.zeros_like(M)
        step[0, c, k] = 1e-5
        difference = statistics.value(data, M + step)[0] - statistics.value(data, M - step)[0]
        assert slope[c, k] == pytest.approx(difference / 4e-5, rel=1e-4, abs=1e-6)


@given(SEEDS, FOCAL)
def test_applied_matrix_is_the_second_derivative(rng: np.random.Generator, focal: float) -> None:
    basis, W, M = scene(rng)
    data = frame_statistics(basis, W, weights_of(rng, W.shape[1]), focal)
    direction = rng.normal(size=M.shape)
    curvature = (direction * statistics.apply(data, direction[:, None])[:, 0]).sum()
    along = [statistics.value(data, M + k * direction)[0] for k in (-1, 0, 1)]
    assert curvature == pytest.approx((along[0] - 2 * along[1] + along[2]) / 2, rel=1e-6, abs=1e-8)


@given(SEEDS)
def test_points_that_are_not_seen_may_be_anything(rng: np.random.Generator) -> None:
    basis, W, M = scene(rng)
    h = weights_of(rng, W.shape[1])
    broken = np.where(h > 0, W, np.nan)
    clean, lost = (frame_statistics(basis, w, h, 2.0) for w in (np.where(h > 0, W, 0.0), broken))
    np.testing.assert_allclose(statistics.value(lost, M), statistics.value(clean, M), rtol=1e-12)
    assert np.isfinite(lost.gram).all()


def test_no_point_seen_is_no_data() -> None:
    basis, W, M = scene(np.random.default_rng(0))
    data = frame_statistics(basis, np.full_like(W, np.nan), np.zeros(W.shape[1]), 2.0)
    assert statistics.value(data, M).tolist() == [0.0]


@given(SEEDS, FOCAL)
def test_stacked_frames_keep_their_values(rng: np.random.Generator, focal: float) -> None:
    basis, _, _ = scene(rng)
    M = rng.normal(size=(3, 3, len(basis)))
    parts = [frame_statistics(basis, rng.normal(size=(2, 30)), weights_of(rng, 30), focal) for _ in range(3)]
    together = stack(parts)
    assert isinstance(together, Statistics)
    assert len(together) == 3
    apart = [statistics.value(part, m[None])[0] for part, m in zip(parts, M, strict=True)]
    np.testing.assert_allclose(statistics.value(together, M), apart)


@given(SEEDS)
def test_a_weight_of_two_is_a_point_seen_twice(rng: np.random.Generator) -> None:
    basis, W, M = scene(rng)
    h = np.ones(30)
    h[4] = 2.0
    twice = frame_statistics(np.c_[basis, basis[:, 4]], np.c_[W, W[:, 4]], np.ones(31), 2.0)
    once = frame_statistics(basis, W, h, 2.0)
    np.testing.assert_allclose(statistics.value(once, M) * 30, statistics.value(twice, M) * 31)
