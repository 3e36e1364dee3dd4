"""Evidence for a rigid shape: turn enough, and frames that agree."""

import numpy as np
import pytest
from hypothesis import given

from reconstruction.mapping.first.evidence import apparent_change, foreshortening_degrees, judging_points, weigh
from tests.reconstruction.world import ORTHOGRAPHIC, SEEDS, flat, relief, rolled, seen, turn, turns, views

FRAMES, POINTS = 15, 60


@pytest.mark.parametrize(("degrees", "trusted"), [(0.0, False), (2.0, False), (25.0, True)])
def test_evidence_for_a_rigid_shape_grows_with_the_turn(degrees: float, trusted: bool) -> None:
    rng = np.random.default_rng(1)
    W, visible = views(relief(rng, POINTS), turns(FRAMES, degrees), ORTHOGRAPHIC)
    evidence = weigh(W + rng.normal(0, 0.1, W.shape), visible)
    assert (evidence.doubt == "") == trusted, evidence.doubt
    if degrees == 0.0:
        assert evidence.turn_degrees < 10
        assert "turned" in evidence.doubt
        assert "10° are needed" in evidence.doubt


def test_a_flat_sheet_is_not_taken_for_a_solid() -> None:
    rng = np.random.default_rng(2)
    W, visible = views(flat(rng, POINTS), turns(FRAMES), ORTHOGRAPHIC)
    assert weigh(W + rng.normal(0, 0.2, W.shape), visible).doubt


def test_a_deforming_sheet_is_not_taken_for_a_solid() -> None:
    rng = np.random.default_rng(3)
    sheet = flat(rng, POINTS)
    shapes = np.stack([rolled(sheet, 0.012 * np.sin(f / 2)) for f in range(FRAMES)])
    W, _ = seen(shapes, turns(FRAMES, 8.0), ORTHOGRAPHIC)
    assert weigh(W, np.ones((FRAMES, POINTS), bool)).doubt


@given(SEEDS)
def test_similarities_are_no_apparent_change(rng: np.random.Generator) -> None:
    shape = relief(rng, POINTS)
    W = np.stack([(1 + 0.1 * f) * (turn((0, 0, 10 * f)) @ shape)[:2] + 3 * f for f in range(5)])
    visible = np.ones((5, POINTS), bool)
    assert apparent_change(W, visible) < 1e-5
    assert foreshortening_degrees(W, visible) < 0.5
    bent = W.copy()
    bent[3] += 4 * rng.normal(size=bent[3].shape)  # of about 60 px
    assert apparent_change(bent, visible) > 0.03


def test_foreshortening_of_a_sheet_is_its_turn() -> None:
    W, visible = views(flat(np.random.default_rng(0), POINTS), np.stack([np.eye(3), turn((0, 40, 0))]), ORTHOGRAPHIC)
    assert foreshortening_degrees(W, visible) == pytest.approx(40, abs=0.5)


def test_judging_points_are_well_spread_and_often_seen() -> None:
    rng = np.random.default_rng(0)
    W = rng.uniform(0, 500, (10, 2, 600))
    visible = np.ones((10, 600), bool)
    visible[3:, 300:] = False
    chosen = judging_points(W, visible)
    assert len(set(chosen.tolist())) == len(chosen)
    assert chosen.max() < 300
