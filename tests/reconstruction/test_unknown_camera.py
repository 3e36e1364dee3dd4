"""A camera that nobody knows is told by what it sees: solids and sheets, near and far, in any unit."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from reconstruction.camera import Camera, lens
from reconstruction.mapping import maps
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.maps import map_of
from reconstruction.mapping.selection import Evidence
from reconstruction.mapping.solid.rivals import Misfit
from reconstruction.unknown_camera import USUAL_LENS, changes, likely_camera, shows_perspective
from tests.reconstruction.mapping.bending import CAMERA, folding_sheet, waving_sheet
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, relief, seen, turns

FRAMES, POINTS = 20, 100


def solid_seen(camera: Camera) -> np.ndarray:
    """Images (F, 2, p) px."""
    rng = np.random.default_rng(2)
    W, _ = seen(np.repeat(relief(rng, POINTS)[None], FRAMES, axis=0), turns(FRAMES), camera)
    return W + 0.1 * rng.normal(size=W.shape)


@pytest.mark.parametrize("unit", [1.0, pytest.param(1e-3, marks=pytest.mark.slow)])
def test_of_a_solid(unit: float) -> None:
    everything = np.ones((FRAMES, POINTS), bool)
    assert not likely_camera(unit * solid_seen(ORTHOGRAPHIC), everything).perspective
    found = likely_camera(unit * solid_seen(PERSPECTIVE), everything)
    assert found.focal_px == pytest.approx(unit * PERSPECTIVE.focal_px, rel=0.1)


@pytest.mark.slow
def test_of_a_sheet(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    W, S = waving_sheet(rng, FRAMES)
    visible = rng.random((FRAMES, W.shape[2])) > 0.2
    found = likely_camera(np.where(visible[:, None], W, np.nan), visible)
    assert found.focal_px == pytest.approx(CAMERA.focal_px, rel=0.15)
    parallel = 200 * S[:, :2] + 0.1 * rng.normal(size=W.shape)
    assert not likely_camera(np.where(visible[:, None], parallel, np.nan), visible).perspective
    monkeypatch.setattr(maps, "under_its_focal_length", lambda found: found)  # it tells none, but that there is one
    assert likely_camera(np.where(visible[:, None], W, np.nan), visible).perspective


def test_creases_are_no_perspective() -> None:
    rng = np.random.default_rng(3)
    W, S = folding_sheet(rng)
    size, shapes = np.sqrt(W.var(axis=2).sum(axis=1).mean()), S[:, :2] / np.sqrt(S[:, :2].var(axis=2).sum(axis=1).mean())
    for image, perspective in ((W, True), (size * shapes + 0.1 * rng.normal(size=W.shape), False)):
        found = map_of(image, np.ones((len(W), W.shape[2]), bool), lens(image, USUAL_LENS), estimate_focal=True)
        assert found is not None
        assert found.sheet is not None
        assert len(found.sheet.field.creases) == 1
        assert shows_perspective(found.sheet, image) == perspective


def test_what_is_not_proven_tells_no_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Evidence, "proven", False)  # the solid above, whose camera is told otherwise
    assert not likely_camera(solid_seen(PERSPECTIVE), np.ones((FRAMES, POINTS), bool)).perspective


@pytest.mark.parametrize("kind", ["sheet", "solid"])
def test_the_same_kind_is_compared_before_both_cameras(kind: str) -> None:
    W, everything = solid_seen(PERSPECTIVE), np.ones((FRAMES, POINTS), bool)
    found = map_of(W, everything, PERSPECTIVE, estimate_focal=False)
    assert found is not None
    assert found.evidence is not None
    parallel, near = (
        replace(found, evidence=replace(found.evidence, told_px=sheet, solid=Misfit(solid, solid)))
        for sheet, solid in ((0.24, 0.32), (0.23, 0.35))
    )
    if kind == "sheet":
        warps = SimpleNamespace(noise_px=np.array([0.1, 0.2, 0.3]))
        near = replace(near, sheet=cast(IsometricSheet, SimpleNamespace(warps=warps)))
    beyond_noise = np.sqrt([0.24**2 - 0.04, 0.23**2 - 0.04])
    assert changes(parallel, near) == pytest.approx(beyond_noise if kind == "sheet" else (0.32, 0.35))


def test_few_frames_do_not_tell() -> None:
    W = solid_seen(PERSPECTIVE)[:4]
    assert not likely_camera(W, np.ones((4, POINTS), bool)).perspective
    assert not likely_camera(W, np.zeros((4, POINTS), bool)).perspective
