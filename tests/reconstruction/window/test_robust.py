"""Robust weights: far points count little, near ones fully."""

import numpy as np
from hypothesis import given, settings

from reconstruction.window.robust import off_the_common_motion, robust_weights, start_weights
from tests.reconstruction.world import SEEDS, relief, turns

FRAMES, POINTS = 12, 60


def test_robust_weights_spare_the_crowd() -> None:
    rng = np.random.default_rng(0)
    residuals = rng.normal(size=(2, 100))
    residuals[:, :5] += 60
    visible = np.ones(100, bool)
    visible[95:] = False
    weights = robust_weights(residuals, visible)
    assert weights[:5].max() < 0.05
    assert weights[5:95].min() > 0.9
    np.testing.assert_array_equal(weights[95:], 0.0)


def test_few_points_all_count() -> None:
    rng = np.random.default_rng(0)
    visible = np.arange(POINTS) < 3
    np.testing.assert_array_equal(robust_weights(100 * rng.normal(size=(2, POINTS)), visible), visible)
    shape = relief(rng, POINTS)
    np.testing.assert_array_equal(start_weights(shape, 100 * rng.normal(size=(2, POINTS)), visible, 80.0), visible)


@settings(max_examples=20)
@given(SEEDS)
def test_one_frames_outliers_stand_out_from_a_fast_motion(rng: np.random.Generator) -> None:
    shape = relief(rng, POINTS)
    W = (turns(FRAMES)[3] @ shape)[:2] + 80
    visible = rng.random(POINTS) < 0.9
    gross = np.flatnonzero(visible)[::4]
    wild = W.copy()
    wild[:, gross] += 100 * np.where(rng.random((2, len(gross))) < 0.5, -1, 1)
    off = np.linalg.norm(off_the_common_motion(shape, np.where(visible, wild, np.nan), visible, 7.0), axis=0)
    assert off[gross].min() > 60
    assert np.delete(off, gross).max() < 6
    assert (off[~visible] == 0).all()
