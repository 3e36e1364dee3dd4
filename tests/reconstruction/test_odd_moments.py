"""What happens at an awkward moment: hidden when another model comes, few points after a loss, two points in one place."""

import numpy as np
import pytest

import reconstruction.mapping.mapper
from reconstruction.arrays import Array
from reconstruction.basis import rest_shape
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.evaluation import e3d
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from tests.reconstruction.runs import SETTINGS, shapes_of, still_sheet, swelling_hill
from tests.reconstruction.world import (
    ORTHOGRAPHIC,
    PERSPECTIVE,
    bending_sheet,
    flat,
    relief,
    rolled,
    seen,
    turn,
    turns,
)

FEW_MODES = Settings(modes=8)


def off_px(estimates: list[ShapeEstimate], W: Array) -> Array:
    """Mean reprojection error (F,) px."""
    return np.array([np.linalg.norm(one.projection_px.T - w, axis=0).mean() for one, w in zip(estimates, W, strict=True)])


@pytest.mark.parametrize("seed", [0, 4])
def test_without_perspective_another_model_goes_on_where_the_last_was(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frames, sheet = 130, flat(np.random.default_rng(seed), 60 + 3 * seed)
    a, b, c = rng.uniform(0.02, 0.05, 3)
    shapes = np.stack([rolled(sheet, 0.008 * np.sin(2 * a * f + seed)) for f in range(frames)])
    R = np.stack([turn((10 * np.sin(b * f), 16 * np.sin(c * f + seed), 3 * f / frames)) for f in range(frames)])
    W, truth = seen(shapes, R @ turn((15, -10, 0)), ORTHOGRAPHIC)
    W = W + rng.normal(0, 0.1, W.shape)
    run, found, revised = Reconstruction(ORTHOGRAPHIC, FEW_MODES), [], []
    for w in W:
        before = run.revisions
        found += run.update(w, np.ones(W.shape[2], bool))
        if run.revisions > before:
            revised.append(len(found) - 1)
    found += run.finish()
    assert revised
    for k in revised:
        before, after = (one.shape[2] - one.shape[2].mean() for one in found[k - 1 : k + 1])
        assert before @ after > 0.5 * np.linalg.norm(before) * np.linalg.norm(after)
    assert e3d(shapes_of(found), truth).mean() < 0.02


@pytest.mark.parametrize("shown", [0, 6])
def test_a_surface_hidden_when_another_model_comes_keeps_its_shape(shown: int) -> None:
    W, _ = bending_sheet(frames=120)
    run, found, hidden = Reconstruction(PERSPECTIVE, FEW_MODES), [], 0
    for w in W:
        visible = np.ones(W.shape[2], bool)
        visible[shown:] = hidden == 0
        before, hidden = run.revisions, max(hidden - 1, 0)
        found += run.update(w, visible)
        hidden = 2 if run.revisions > before else hidden
    found += run.finish()
    assert run.revisions
    assert off_px(found, W).max() < 6.0


def test_three_points_after_a_loss_are_waited_out() -> None:
    W, truth = swelling_hill()
    run, every = Reconstruction(PERSPECTIVE, SETTINGS, rest_shape.given(truth[0], "truth", "")), np.ones(W.shape[2], bool)
    for w in W[:10]:
        run.update(w, every)
    run.restart()
    (found,) = run.update(W[10], np.arange(W.shape[2]) < 3)
    assert np.isfinite(found.shape).all()


def test_a_loss_long_ago_is_forgotten() -> None:
    W, _ = bending_sheet(frames=170)
    W[125:, 0] += 80  # it comes back elsewhere
    run, found = Reconstruction(PERSPECTIVE, FEW_MODES), []
    for k, w in enumerate(W):
        if k == 125:
            run.restart()
        found += run.update(w, np.full(W.shape[2], not 150 <= k < 154))
    assert off_px(found + run.finish(), W)[145:160].max() < 10.0


def test_first_frames_are_looked_at_once_though_the_surface_is_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    looked, W = [], still_sheet()

    monkeypatch.setattr(reconstruction.mapping.mapper, "bootstrap", lambda first, *_: looked.append(len(first)))
    run = Reconstruction(PERSPECTIVE, FEW_MODES)
    for k, w in enumerate(W[:40]):
        run.update(w, np.full(W.shape[2], not 9 < k < 30))
    assert looked == [10, 15, 20]


@pytest.mark.parametrize("kind", ["solid", "sheet"])
def test_two_of_a_few_points_in_one_place(kind: str) -> None:
    rng, camera, frames = np.random.default_rng(1), PERSPECTIVE, 66
    W = solid(rng, camera, frames) if kind == "solid" else bending_sheet(camera, 21, frames)[0]
    W = W + rng.normal(0, 0.1, W.shape)
    W[:, :, 1] = W[:, :, 0]
    run = Reconstruction(camera, Settings())
    found = [one for w in W for one in run.update(w, np.ones(W.shape[2], bool))]
    assert off_px(found + run.finish(), W).max() < 2.0


def solid(rng: np.random.Generator, camera: Camera, frames: int) -> Array:
    """Images (F, 2, 16) px of a hilly solid that turns."""
    return seen(np.broadcast_to(relief(rng, 16), (frames, 3, 16)), turns(frames), camera)[0]
