"""Cloth is held where it is held, falls, and hardly stretches."""

import numpy as np
import pytest

from app.synthetic import cloth
from app.synthetic.cloth import COLUMNS, ROWS, gusts, net, norm, simulated


@pytest.fixture(autouse=True)
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cloth, "FRAMES", 16)
    monkeypatch.setattr(cloth, "WARM_UP", 2)


def test_it_falls_from_where_it_is_held_and_keeps_its_lengths() -> None:
    held = np.zeros((ROWS, COLUMNS), bool)
    held[0] = True
    shapes = simulated(held, lambda time: np.array([0.0, 0.0, 0.1 * time]), lambda _: np.array([0.0, 0.0, 3.0]))
    assert shapes.shape == (16, 3, ROWS, COLUMNS)
    flat, time = net(), np.arange(16) / 30
    np.testing.assert_allclose(shapes[:, :, 0], flat[:, 0] + time[:, None, None] * [[0.0], [0.0], [0.1]], atol=1e-3)
    assert shapes[-1, 2, -1].mean() > 0.02  # the wind blows it to the back
    for axis in (1, 2):
        lengths = np.stack([norm(np.diff(shape, axis=axis)) for shape in shapes]) / norm(np.diff(flat, axis=axis))
        assert np.abs(lengths - 1).max() < 0.05
        assert np.abs(lengths - 1).mean() < 0.005


def test_a_wind_is_the_same_for_the_same_numbers_and_sways_about_its_mean() -> None:
    winds = [gusts(np.random.default_rng(seed), (4.0, 0.0, 0.0), (1.0, 0.5, 0.2)) for seed in (1, 1, 2)]
    first, again, other = (np.stack([wind(time) for time in np.linspace(0, 60, 2000)]) for wind in winds)
    np.testing.assert_array_equal(first, again)
    assert not np.allclose(first, other)
    np.testing.assert_allclose(first.mean(axis=0), [4.0, 0.0, 0.0], atol=0.05)
    assert np.all(first.std(axis=0) < [1.0, 0.5, 0.2])
