"""The first model, by the first frames alone."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.mapping.first.bootstrap import bootstrap
from reconstruction.settings import Settings
from tests.reconstruction.runs import swelling_hill
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, bending_sheet, seen, spread, turns


def test_a_solid_is_known_as_soon_as_it_has_turned() -> None:
    W, _ = swelling_hill(ORTHOGRAPHIC)
    visible = np.ones((len(W), W.shape[2]), bool)
    found = [bootstrap(W[:n], visible[:n], ORTHOGRAPHIC, Settings(), False) for n in (5, 15)]
    assert found[0] is None
    assert found[1] is not None
    assert found[1].rest.kind == "rigid"


def test_a_card_that_folds_is_no_rigid_shape() -> None:
    """Factorisation explains it by one that turns by 70°; only who says that it is rigid gets that."""
    rng = np.random.default_rng(0)
    x, y = spread(rng, 100)
    shapes = np.stack([np.stack([np.cos(a) * x, y, np.sin(a) * np.abs(x)]) for a in np.radians(np.linspace(10, 30, 15))])
    W = seen(shapes, turns(15, 5.0), ORTHOGRAPHIC)[0] + 0.1 * rng.normal(size=(15, 2, 100))
    visible = np.ones((15, 100), bool)
    assert bootstrap(W, visible, ORTHOGRAPHIC, Settings(), False) is None
    last = bootstrap(W, visible, ORTHOGRAPHIC, Settings(), True)
    assert last is not None
    assert last.rest.kind == "plane"
    assert "the object may deform" in last.rest.note
    asked = bootstrap(W, visible, ORTHOGRAPHIC, Settings(rest_shape="rigid"), False)
    assert asked is not None
    assert asked.rest.kind == "rigid"


def test_without_evidence_it_is_a_sheet_and_says_why() -> None:
    W, _ = bending_sheet()
    visible = np.ones((len(W), W.shape[2]), bool)
    assert bootstrap(W[:8], visible[:8], PERSPECTIVE, Settings(), False) is None
    found = bootstrap(W[:8], visible[:8], PERSPECTIVE, Settings(), True)
    assert found is not None
    assert found.rest.kind == "plane"
    assert "too few frames for a rigid shape" in found.rest.note


def test_a_focal_length_that_nobody_gave_is_said_to_be_assumed() -> None:
    W, _ = bending_sheet()
    visible = np.ones((len(W), W.shape[2]), bool)
    for estimate_focal in (True, False):
        settings = replace(Settings(rest_shape="plane"), estimate_focal=estimate_focal)
        found = bootstrap(W, visible, PERSPECTIVE, settings, True)
        assert found is not None
        assert found.camera.focal_px == PERSPECTIVE.focal_px
        assert ("assumed" in found.focal_note) is estimate_focal


@pytest.mark.parametrize("seen_later", [False, True])
def test_points_that_come_and_go_are_a_start_all_the_same(seen_later: bool) -> None:
    """Tracks begin and end anywhere: frames of few points, and points of few frames, tell nothing, and stop nothing."""
    W, _ = bending_sheet()
    frames, points = len(W), W.shape[2]
    rng = np.random.default_rng(0)
    if seen_later:  # most points, for the first time
        first = rng.integers(-frames // 2, 3 * frames, points)
        visible = (np.arange(frames)[:, None] >= first) & (np.arange(frames)[:, None] < first + frames)
    else:  # four of many points in two of the frames
        W, visible = np.tile(W, 4) + rng.normal(0, 1, (1, 2, 4 * points)), np.ones((frames, 4 * points), bool)
        visible[:2, 4:] = False
    found = bootstrap(np.where(visible[:, None], W, np.nan), visible, PERSPECTIVE, Settings(), True)
    assert found is not None
    assert np.isfinite(found.rest.motion.shape[:, visible.any(axis=0)]).all()
