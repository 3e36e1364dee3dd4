"""A rest shape that later frames improve: what it learns, what it keeps, and that everything else stays consistent."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.basis import rest_shape
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.evaluation import e3d
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from reconstruction.state import State
from reconstruction.window.refinement import FEWEST, Refinement
from reconstruction.window.statistics import Statistics
from reconstruction.window.terms import data_normal
from tests.reconstruction.world import (
    ORTHOGRAPHIC,
    PERSPECTIVE,
    model_of,
    random_state,
    relief,
    seen,
    statistics_of,
    turns,
)

POINTS, FRAMES = 70, 40
BENDING = Settings(modes=8, deformation="bending")


def turning(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Images (F, 2, p) px of a solid that turns, its shapes, and a rest shape that is wrong along the surface."""
    true = relief(np.random.default_rng(0), POINTS)
    W, shapes = seen(np.broadcast_to(true, (FRAMES, 3, POINTS)), turns(FRAMES), camera)
    x, y, _ = true
    return W, shapes, true + np.stack([8 * np.sin(y / 40), -8 * np.sin(x / 40), 0 * x])


def reconstructed(
    W: np.ndarray, rest: np.ndarray, camera: Camera, settings: Settings
) -> tuple[Reconstruction, list[ShapeEstimate]]:
    reconstruction = Reconstruction(camera, settings, rest_shape.given(rest, "mesh", ""))
    return reconstruction, [reconstruction.update(w, np.ones(POINTS, bool))[0] for w in W]


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE], ids=["orthographic", "perspective"])
def test_later_frames_correct_what_the_deformation_cannot(camera: Camera) -> None:
    W, truth, wrong = turning(camera)
    still, refined = (
        np.stack([one.shape for one in reconstructed(W, wrong, camera, replace(BENDING, refine_rest=refine))[1]])
        for refine in (False, True)
    )
    first = BENDING.window + FEWEST - 1
    np.testing.assert_array_equal(refined[:first], still[:first])  # nothing is known yet
    assert e3d(refined[-5:], truth[-5:]).mean() < 0.8 * e3d(still[-5:], truth[-5:]).mean()


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE], ids=["orthographic", "perspective"])
def test_model_and_coefficients_give_the_shapes_as_ever(camera: Camera) -> None:
    W, _, wrong = turning(camera)
    reconstruction, estimates = reconstructed(W, wrong, camera, BENDING)
    basis = reconstruction.model.basis
    np.testing.assert_allclose(basis.rest, wrong - wrong.mean(axis=1, keepdims=True), atol=1e-9)
    assert np.abs(estimates[-1].Lambda[:2]).max() > 1  # px, along the surface: the refined rest
    for one in estimates:
        expected = one.s * one.R @ basis.deform(one.Lambda) if not camera.perspective else one.R @ basis.deform(one.Lambda)
        apart = one.shape - expected
        np.testing.assert_allclose(apart, np.broadcast_to(apart[:, :1], apart.shape), atol=1e-6)


def test_the_papers_energy_keeps_its_rest_shape() -> None:
    W, _, wrong = turning(ORTHOGRAPHIC)
    _, estimates = reconstructed(W, wrong, ORTHOGRAPHIC, replace(BENDING, energy="paper"))
    assert np.abs(np.stack([one.Lambda[:2] for one in estimates])).max() == 0.0


def test_after_a_restart_the_refined_rest_is_kept() -> None:
    W, truth, wrong = turning(ORTHOGRAPHIC)
    reconstruction, before = reconstructed(W, wrong, ORTHOGRAPHIC, BENDING)
    reconstruction.restart()
    again = reconstruction.update(W[-1], np.ones(POINTS, bool))[0]
    assert e3d(again.shape[None], truth[-1:])[0] < 1.3 * e3d(before[-1].shape[None], truth[-1:])[0]


def observed(camera: Camera, frames: int) -> tuple[list[Statistics], list[State], np.ndarray]:
    """Frames of a surface that rests somewhere else (3, r), with poses known, as the undeformed model sees them."""
    rng = np.random.default_rng(0)
    model = model_of(relief(rng, POINTS), camera, 4)
    rest = 0.05 * rng.normal(size=(3, 4))
    state = random_state(rng, frames, 4)
    true = replace(state, Lambda=np.broadcast_to(rest, (frames, 3, 4)).copy())
    W = np.stack([model.projection(true, f) for f in range(frames)])
    data = [statistics_of(model, w[None], np.ones((1, POINTS))) for w in W]
    undeformed = replace(state, Lambda=np.zeros((frames, 3, 4)))
    return data, [undeformed[f : f + 1] for f in range(frames)], rest


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE], ids=["orthographic", "perspective"])
def test_a_rest_elsewhere_is_found_but_not_from_few_frames(camera: Camera) -> None:
    data, states, rest = observed(camera, 60)
    refinement, gaps = Refinement(4), []
    for one, state in zip(data, states, strict=True):
        refinement.add(data_normal(one, replace(state, Lambda=refinement.rest[None].copy())))
        gaps.append(np.linalg.norm(refinement.rest - rest) / np.linalg.norm(rest))
    assert gaps[FEWEST - 2] == pytest.approx(1.0)
    assert gaps[FEWEST - 1] < 0.8
    assert gaps[-1] < 0.3


def test_frames_without_points_say_nothing_and_what_is_known_fades() -> None:
    data, states, rest = observed(ORTHOGRAPHIC, 30)
    refinement = Refinement(4)
    for one, state in zip(data, states, strict=True):
        refinement.add(data_normal(one, replace(state, Lambda=refinement.rest[None].copy())))
    found = np.linalg.norm(refinement.rest)
    nothing = Statistics(0 * data[0].gram, 0 * data[0].cross, 0 * data[0].power)
    for _ in range(1000):
        refinement.add(data_normal(nothing, replace(states[0], Lambda=refinement.rest[None].copy())))
    assert found > 0.7 * np.linalg.norm(rest)
    assert np.linalg.norm(refinement.rest) < 1e-3 * found
