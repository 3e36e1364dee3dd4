"""Keyframes: spread, bounded, whatever the units, gaps and gross errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction import ReconstructionError
from reconstruction.mapping.keyframes import Keyframes, difference, farthest_first, spread_of
from tests.reconstruction.mapping.bending import waving_sheet

POINTS = 80


def chosen(W: np.ndarray, visible: np.ndarray, capacity: int = 8) -> Keyframes:
    keyframes = Keyframes(capacity)
    for f, (w, h) in enumerate(zip(W, visible, strict=True)):
        keyframes.offer(f, np.where(h, w, np.nan), h)
    return keyframes


def spacing(W: np.ndarray, frames: list[int]) -> float:
    seen = np.ones(W.shape[2], bool)
    apart = np.array([difference(W[f], seen, W[frames], np.ones((len(frames), W.shape[2]), bool)) for f in frames])
    return float(apart[np.triu_indices(len(frames), 1)].min())


def test_they_are_spread_and_no_more_than_asked_for() -> None:
    W, _ = waving_sheet(np.random.default_rng(1), frames=120, points=POINTS)
    keyframes = chosen(W, np.ones((120, POINTS), bool))
    assert len(keyframes.frames) == 8
    even = [int(f) for f in np.linspace(0, 119, 8)]
    assert spacing(W, keyframes.frames) > spacing(W, even)


def test_all_at_once_they_are_the_same() -> None:
    W, _ = waving_sheet(np.random.default_rng(3), frames=60, points=POINTS)
    visible = np.random.default_rng(4).random((60, POINTS)) < 0.7
    once, _, frames = spread_of(zip(W, visible, strict=True), 8)
    before, _, same = chosen(W, visible).spread()
    np.testing.assert_array_equal(frames, same)
    np.testing.assert_array_equal(once, before)
    with pytest.raises(ReconstructionError, match="no frame shows"):
        spread_of([(W[0], np.zeros(POINTS, bool))], 8)


def test_a_still_scene_changes_nothing_any_more() -> None:
    W, _ = waving_sheet(np.random.default_rng(2), frames=40, points=POINTS)
    seen = np.ones((40, POINTS), bool)
    keyframes = chosen(W, seen)
    before = keyframes.version
    assert not any(keyframes.offer(100 + k, W[keyframes.frames[-1]], seen[0]) for k in range(20))
    assert keyframes.version == before


@settings(max_examples=5, deadline=None)
@given(unit=st.sampled_from([1e-3, 1.0, 1e3]), seed=st.integers(0, 100))
def test_units_and_place_do_not_matter(unit: float, seed: int) -> None:
    W, _ = waving_sheet(np.random.default_rng(seed), frames=40, points=POINTS)
    seen = np.ones((40, POINTS), bool)
    assert chosen(W, seen).frames == chosen(W * unit + 7, seen).frames


def test_gaps_and_gross_errors_do_not_look_like_views() -> None:
    rng = np.random.default_rng(3)
    W, _ = waving_sheet(rng, frames=60, points=POINTS)
    visible = rng.random((60, POINTS)) > 0.4
    W = np.where((rng.random((60, POINTS)) < 0.1)[:, None], 1000.0, W)
    clean, _ = waving_sheet(np.random.default_rng(3), frames=60, points=POINTS)
    kept = chosen(W, visible).frames
    assert spacing(clean, kept) > 0.3 * spacing(clean, chosen(clean, np.ones_like(visible)).frames)


def test_what_is_given_out_begins_with_the_most_different() -> None:
    W, _ = waving_sheet(np.random.default_rng(4), frames=30, points=POINTS)
    visible = np.random.default_rng(5).random((30, POINTS)) > 0.2
    out, seen, frames = chosen(W, visible).spread(5)
    assert out.shape == (5, 2, POINTS)
    assert np.isnan(out[:, 0][~seen]).all()
    np.testing.assert_array_equal(out[0][:, seen[0]], W[frames[0]][:, visible[frames[0]]])


def test_frames_that_show_almost_nothing_are_not_taken() -> None:
    keyframes = Keyframes()
    assert not keyframes.offer(0, np.zeros((2, POINTS)), np.zeros(POINTS, bool))


def test_order_is_farthest_first() -> None:
    x = np.array([0.0, 1.0, 2.0, 10.0])
    assert list(farthest_first(np.abs(x[:, None] - x), 4)) == [3, 0, 2, 1]
