import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tracking.consistency import Surroundings, nearest_neighbours

seeds = st.integers(0, 2**32 - 1)


def identity(n: int) -> np.ndarray:
    return np.broadcast_to(np.eye(2), (n, 2, 2))


def grid(n: int = 14, spacing: float = 10.0) -> np.ndarray:
    jitter = np.random.default_rng(0).uniform(-2, 2, (n * n, 2))
    return spacing * np.argwhere(np.ones((n, n))) + jitter


def bent(points: np.ndarray) -> np.ndarray:
    x, y = points.T
    return np.stack([0.8 * x + 0.1 * y + 4 * np.sin(y / 40), 1.1 * y - 0.2 * x + 3 * np.cos(x / 50)], axis=1)


@given(seeds, st.integers(2, 40))
def test_neighbours_are_the_nearest_others(seed: int, count: int) -> None:
    points = np.random.default_rng(seed).uniform(0, 100, (count, 2))
    found = nearest_neighbours(points, 7)
    k = min(7, count - 1)
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    np.testing.assert_allclose(np.take_along_axis(distance, found, 1), np.sort(distance, axis=1)[:, :k])


def test_neighbours_of_many_points_cross_the_blocks() -> None:
    points = np.random.default_rng(0).uniform(0, 1000, (1300, 2))
    found = nearest_neighbours(points, 4)
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    np.fill_diagonal(distance, np.inf)
    np.testing.assert_array_equal(found, np.argsort(distance, axis=1)[:, :4])


@given(seeds)
def test_an_affine_motion_is_recovered(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A, t = np.eye(2) + 0.4 * rng.uniform(-1, 1, (2, 2)), rng.uniform(-50, 50, 2)
    points = grid()
    motion = Surroundings(points).motion(points @ A.T + t, np.ones(len(points)), np.tile(A, (len(points), 1, 1)))
    np.testing.assert_allclose(motion.affine, identity(len(points)) * 0 + A, atol=1e-6)
    np.testing.assert_allclose(motion.fitted_px, points @ A.T + t, atol=1e-5)
    assert motion.consistent.all()


@given(seeds, st.floats(0.0, 0.2))
def test_scattered_outliers_are_told_from_a_bent_surface(seed: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    points = grid()
    now = bent(points) + rng.normal(0, 0.15, points.shape)
    wrong = rng.random(len(points)) < share
    angle = rng.uniform(0, 2 * np.pi, int(wrong.sum()))
    now[wrong] += rng.uniform(5, 40, (len(angle), 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    motion = Surroundings(points).motion(now, np.ones(len(points)), identity(len(points)))
    assert np.count_nonzero(motion.consistent[wrong]) <= 0.2 * np.count_nonzero(wrong)
    assert motion.consistent[~wrong].mean() > 0.97


def test_unknown_points_are_placed_by_their_neighbours() -> None:
    points = grid()
    rng = np.random.default_rng(1)
    known = rng.random(len(points)) < 0.6
    now = np.where(known[:, None], bent(points), np.nan)
    motion = Surroundings(points).motion(now, known.astype(float), identity(len(points)))
    assert np.isfinite(motion.fitted_px).all()
    supported = ~known & (motion.support >= 4)
    error = np.linalg.norm(motion.fitted_px - bent(points), axis=1)
    assert supported.sum() > 30
    assert np.median(error[supported]) < 0.3


def test_without_support_nothing_is_said() -> None:
    points = np.array([[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]])
    for weight in (np.ones(3), np.zeros(3)):
        motion = Surroundings(points).motion(points + 100.0, weight, identity(3))
        assert motion.consistent.all()
        assert np.isfinite(motion.affine).all()


def test_neighbours_in_line_fall_back_on_the_prior() -> None:
    points = np.stack([np.arange(20.0) * 5, np.zeros(20)], axis=1)
    prior = np.tile([[1.0, 0.3], [0.0, 0.7]], (20, 1, 1))
    motion = Surroundings(points).motion(points * 2, np.ones(20), prior)
    np.testing.assert_allclose(motion.affine[:, :, 1], prior[:, :, 1], atol=1e-6)
    np.testing.assert_allclose(motion.affine[:, 0, 0], 2.0, atol=0.05)
