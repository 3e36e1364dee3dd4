"""The focal length from the first frames."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.camera import Camera
from reconstruction.mapping.focal import FEWEST, search
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from tests.reconstruction.world import PERSPECTIVE, flat, rolled, seen, turn

FRAMES = 48
SETTINGS = Settings(rest_shape="plane", bootstrap_frames=FRAMES, modes=8, estimate_focal=True)


def sheet(camera: Camera, *, still: bool = False) -> np.ndarray:
    """Images (F, 2, p) px of a sheet that turns, and rolls up in the second half."""
    rest, at = flat(np.random.default_rng(0), 60), np.arange(FRAMES) * (not still)
    shapes = np.stack([rolled(rest, 0.006 * max(0.0, np.sin(np.pi * (2 * f / FRAMES - 1)))) for f in at])
    R = np.stack([turn((25 * np.sin(f / 9), 30 * np.sin(f / 14), 10 * np.sin(f / 11))) for f in at])
    return seen(shapes, R, camera)[0]


def started(W: np.ndarray, assumed_px: float) -> Reconstruction:
    reconstruction = Reconstruction(replace(PERSPECTIVE, focal_px=assumed_px), SETTINGS)
    for w in W:
        reconstruction.update(w, np.ones(W.shape[2], bool))
    return reconstruction


@pytest.mark.parametrize("share", [0.8, pytest.param(1.25, marks=pytest.mark.slow)])
def test_a_sheet_that_turns_holds_it(share: float) -> None:
    noise = np.random.default_rng(1).normal(0, 0.1, (FRAMES, 2, 60))
    reconstruction = started(sheet(PERSPECTIVE) + noise, share * PERSPECTIVE.focal_px)
    assert reconstruction.model.camera.focal_px == pytest.approx(PERSPECTIVE.focal_px, rel=0.05)
    assert "from the first frames" in reconstruction.focal_note
    assert reconstruction.focal_words["focal_px"] == reconstruction.model.camera.focal_px


def test_one_that_stands_still_does_not() -> None:
    noise = np.random.default_rng(1).normal(0, 0.1, (FRAMES, 2, 60))
    reconstruction = started(sheet(PERSPECTIVE, still=True) + noise, 700.0)
    assert reconstruction.model.camera.focal_px == 700.0
    assert "assumed" in reconstruction.focal_note


def test_few_frames_are_not_asked() -> None:
    reconstruction = Reconstruction(PERSPECTIVE, replace(SETTINGS, bootstrap_frames=FEWEST - 1))
    for w in sheet(PERSPECTIVE)[: FEWEST - 1]:
        reconstruction.update(w, np.ones(60, bool))
    assert f"{FEWEST - 1} frames are too few" in reconstruction.focal_note


@pytest.mark.parametrize("truth", [400.0, 640.0, 900.0])
def test_the_least_energy_is_found(truth: float) -> None:
    found = search(lambda focal: 1e-4 + np.log(focal / truth) ** 2 * 1e-3, 600.0)
    assert found.known
    assert found.focal_px == pytest.approx(truth, rel=0.03)


@pytest.mark.parametrize("truth", [200.0, 2600.0])
def test_it_is_looked_for_far_from_the_assumed_one(truth: float) -> None:
    found = search(lambda focal: 1e-4 + np.log(focal / truth) ** 2 * 1e-3, 600.0)
    assert found.known
    assert found.focal_px == pytest.approx(truth, rel=0.03)


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_energy_that_does_not_rise_on_both_sides_says_nothing(slope: float) -> None:
    assert not search(lambda focal: 1.0 + slope * np.log(focal / 600.0) / 4, 600.0).known


def test_one_so_long_that_no_perspective_shows_is_known_from_below() -> None:
    found = search(lambda focal: 1.0 + 1000.0 / focal, 600.0)
    assert found.known
    assert found.focal_px == pytest.approx(8 * 600.0)
    assert "or more" in found.note
