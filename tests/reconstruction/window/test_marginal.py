"""What frames leave behind for those that follow: the algebra, and what it is good for."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from reconstruction.basis import rest_shape
from reconstruction.evaluation import e3d
from reconstruction.state import POSE
from reconstruction.window.energy import build_energy
from reconstruction.window.marginal import carried, information_of
from reconstruction.window.window import SlidingWindow
from tests.reconstruction.world import ORTHOGRAPHIC, SEEDS, model_of, relief, seen, turns

MODES = 4


def positive(rng: np.random.Generator, n: int) -> np.ndarray:
    root = rng.normal(size=(n, n))
    return root @ root.T


@settings(max_examples=20)
@given(rng=SEEDS)
def test_known_is_what_no_pose_explains(rng: np.random.Generator) -> None:
    hessian = positive(rng, POSE + 3 * MODES)
    step = np.concatenate([np.zeros(POSE), rng.normal(size=3 * MODES)])
    for rows in ((0, 1, 2), (0, 1), (2,)):
        free = np.isin(np.arange(3 * MODES) // MODES, rows)
        wanted = step * np.concatenate([np.ones(POSE), free])
        pose = -np.linalg.solve(hessian[:POSE, :POSE], (hessian @ wanted)[:POSE])  # the pose that explains most of it
        wanted[:POSE] = pose
        x = wanted[POSE:][free]
        np.testing.assert_allclose(x @ information_of(hessian, rows) @ x, wanted @ hessian @ wanted, rtol=1e-4)


@settings(max_examples=20)
@given(rng=SEEDS)
def test_carried_is_the_least_that_a_change_costs(rng: np.random.Generator) -> None:
    information, link = positive(rng, MODES), rng.random(MODES) + 0.1
    later = rng.normal(size=MODES)
    earlier = np.linalg.solve(information + np.diag(link), link * later)
    least = earlier @ information @ earlier + link @ (later - earlier) ** 2
    np.testing.assert_allclose(later @ carried(information, link) @ later, least, rtol=1e-9)


@pytest.mark.parametrize("left", [0, 2])
def test_frames_in_which_next_to_nothing_is_seen_are_survived(left: int) -> None:
    rest = relief(np.random.default_rng(3), 60)
    W, truth = seen(np.broadcast_to(rest, (20, 3, 60)), turns(20), ORTHOGRAPHIC)
    model = model_of(rest, ORTHOGRAPHIC, 10)
    window = SlidingWindow(model, build_energy(model, "general"), 3, rest_shape.given(rest, "truth", "").motion)
    found = [window.advance(w, (np.arange(60) < left) | (f not in (8, 12, 13))) for f, w in enumerate(W)]
    assert e3d(np.stack([one.shape for one in found]), truth).max() < 0.01


def test_what_is_not_known_is_not_held() -> None:
    information = np.diag([0.0, 1.0, 1e9])
    held = carried(information, np.array([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(held, np.diag([0.0, 2 / 3, 2.0]), atol=1e-6)


def test_a_deformation_that_lasts_gets_its_depth_as_the_object_turns() -> None:
    rest = relief(np.random.default_rng(3), 60)
    x, y, _ = rest
    bump = 12 * np.exp(-((x - 20) ** 2 + y**2) / 900) * np.array([[0.5], [0.3], [1.0]])
    frames = 50
    shapes = rest + np.where(np.arange(frames) >= 12, 1.0, 0.0)[:, None, None] * bump
    W, truth = seen(shapes, turns(frames), ORTHOGRAPHIC)
    model = model_of(rest, ORTHOGRAPHIC, 20)
    energy = build_energy(model, "general")
    errors = []
    for one in (energy, replace(energy, jump=None, adaptive=False, smoothness=0.1 * energy.smoothness / 5.0)):
        window = SlidingWindow(model, one, 3, rest_shape.given(rest, "truth", "").motion)
        found = [window.advance(w, np.ones(60, bool)) for w in W]
        errors.append(e3d(np.stack([f.shape for f in found]), truth))
    held, let_go = errors
    assert held[-10:].mean() < 0.7 * held[13:16].mean()
    assert held[-10:].mean() < 0.8 * let_go[-10:].mean()
