import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.tracking.scene import SIZE, moved, texture
from tracking.features import detect_corners
from tracking.flow import Flow, Grays, spread_order
from tracking.region.mask import region_mask

BEFORE = Grays.of(texture())
POINTS = detect_corners(BEFORE.full, region_mask(SIZE, (60, 60, 200, 120)), 300)
FLOW = Flow(POINTS)


@settings(max_examples=20, deadline=None)
@given(st.floats(-15, 15), st.floats(-15, 15))
def test_follows_a_shift(dx: float, dy: float) -> None:
    now = moved(BEFORE.full[..., None].repeat(3, axis=2), lambda p: p - [dx, dy])
    error = np.linalg.norm(FLOW.follow(BEFORE, Grays.of(now), POINTS) - POINTS - [dx, dy], axis=1)
    assert np.mean(error < 0.2) > 0.9


@pytest.mark.parametrize("light", ["brighter", "darker", "bands"])
def test_follows_through_a_change_of_light(light: str) -> None:
    rows = 1 + 0.35 * np.sin(np.arange(SIZE[1]) / 25)[:, None, None]
    factor = {"brighter": 1.4, "darker": 0.5, "bands": rows}[light]
    now = np.clip(moved(BEFORE.full[..., None].repeat(3, axis=2), lambda p: p - [4, 3]) * factor, 0, 255).astype(np.uint8)
    error = np.linalg.norm(FLOW.follow(BEFORE, Grays.of(now), POINTS) - POINTS - [4, 3], axis=1)
    assert np.mean(error < 0.3) > 0.9


def test_points_of_a_picture_that_is_gone_do_not_come_back() -> None:
    there = FLOW.follow(BEFORE, Grays.of(texture(seed=1)), POINTS)
    assert np.isnan(there[:, 0]).mean() > 0.7


def test_no_points_and_few_points() -> None:
    assert np.isnan(FLOW.follow(BEFORE, BEFORE, np.full_like(POINTS, np.nan))).all()
    few = np.where(np.arange(len(POINTS))[:, None] < 3, POINTS, np.nan)
    np.testing.assert_allclose(FLOW.follow(BEFORE, BEFORE, few), few, atol=0.01)


@given(st.integers(1, 60), st.integers(0, 2**32 - 1))
def test_every_beginning_of_the_order_is_spread(count: int, seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0, 100, (count, 2))
    order = spread_order(points)
    assert sorted(order) == list(range(count))
    # The gap to the points before shrinks along the order: that is what farthest-first means.
    gaps = [np.linalg.norm(points[order[:i]] - points[order[i]], axis=1).min() for i in range(1, count)]
    assert all(a >= b - 1e-9 for a, b in itertools.pairwise(gaps))
