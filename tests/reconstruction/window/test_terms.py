"""Each term of the energy: analytic derivatives against finite differences, blocks against the residuals' Jacobian."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.basis.constraints import Bending
from reconstruction.state import POSE, State, join
from reconstruction.window import statistics
from reconstruction.window.energy import Energy
from reconstruction.window.marginal import Previous
from reconstruction.window.statistics import Statistics
from reconstruction.window.terms import HAT, evaluate, linearise
from tests.reconstruction.window.scenes import (
    FRAMES,
    MODES,
    POINTS,
    ROWS,
    SILENT,
    Scene,
    everything,
    held,
    nothing_seen,
    replace_states,
    scene_of,
    terms,
)
from tests.reconstruction.world import (
    CAMERAS,
    SEEDS,
    random_state,
)


def check_gradient(energy: Energy, data: Statistics, scene: Scene, rng: np.random.Generator) -> None:
    """Half the directional derivative, in random directions and along each parameter of the middle frame."""
    state = scene.state
    if not energy.rows:
        state = replace(state, Lambda=np.zeros((FRAMES, 3, 0)))
        data = Statistics(data.gram[:, :, [0, 1, 2, -1]][..., [0, 1, 2, -1]], data.cross[..., [0, 1, 2, -1]], data.power)
        scene = replace_states(scene, state)
    state = energy.completed(state)
    normal = linearise(energy, data, state, scene.before)
    np.testing.assert_allclose(normal.value, evaluate(energy, data, state, scene.before))
    n, d = normal.gradient.shape
    assert (n, d) == (FRAMES, POSE + len(energy.rows) * state.Lambda.shape[2])
    directions = [rng.normal(size=(n, d)) for _ in range(3)]
    for k in range(d):
        directions.append(np.zeros((n, d)))
        directions[-1][1, k] = 1.0
    h = 1e-6
    for direction in directions:
        if not energy.free_scale:
            direction[:, 5] = 0.0
        moved = [energy.completed(state.moved(k * direction, energy.rows)) for k in (h, -h)]
        values = [evaluate(energy, data, one, scene.before).sum() for one in moved]
        slope = (values[0] - values[1]) / (4 * h)
        assert (normal.gradient * direction).sum() == pytest.approx(slope, rel=1e-5, abs=1e-6 * (1 + abs(values[0])))


@pytest.mark.parametrize("term", ["rotation", "scale", "smoothness", "jumps", "rest", "inextensibility"])
@settings(max_examples=10)
@given(rng=SEEDS, tied=st.booleans(), known=st.booleans())
def test_gradient_of_each_prior(term: str, rng: np.random.Generator, tied: bool, known: bool) -> None:
    scene = scene_of(rng)
    if known:
        scene = held(scene, rng, (0, 1, 2))
    energy = replace(terms(scene)[term], tied=tied)
    data = nothing_seen(scene)
    assert evaluate(energy, data, scene.state, scene.before).sum() > 0
    check_gradient(energy, data, scene, rng)


@settings(max_examples=20)
@given(rng=SEEDS, camera=CAMERAS)
def test_gradient_of_the_data(rng: np.random.Generator, camera) -> None:  # type: ignore[no-untyped-def]
    scene = scene_of(rng, camera)
    check_gradient(SILENT, scene.data, scene, rng)


@settings(max_examples=30)
@given(rng=SEEDS, camera=CAMERAS, rows=ROWS, tied=st.booleans(), free_scale=st.booleans())
def test_gradient_of_everything(rng, camera, rows, tied, free_scale) -> None:  # type: ignore[no-untyped-def]
    scene = scene_of(rng, camera)
    energy = replace(everything(scene, rows, tied=tied), free_scale=free_scale)
    if not rows:
        energy = replace(energy, edges=None, inextensibility=0.0, rest=0.0)
    check_gradient(energy, scene.data, scene, rng)


@settings(max_examples=20)
@given(rng=SEEDS, camera=CAMERAS, tied=st.booleans())
def test_gradient_of_a_sheet_that_only_bends(rng, camera, tied) -> None:  # type: ignore[no-untyped-def]
    scene = scene_of(rng, camera)
    bending = Bending(scene.model.coarse_edges(12), np.array([0.5, 0.9, 1.3]))
    energy = replace(everything(scene, (2,), tied=tied), bending=bending)
    energy = energy.about(0.1 * rng.normal(size=(3, MODES)))
    check_gradient(energy, scene.data, scene, rng)


def test_rows_that_are_not_free_are_put_at_rest() -> None:
    state = random_state(np.random.default_rng(0), 3, 4)
    rest = np.arange(12.0).reshape(3, 4)
    placed = Energy(rows=(2,), centre=rest).completed(state)
    np.testing.assert_array_equal(placed.Lambda[:, :2], np.broadcast_to(rest[:2], (3, 2, 4)))
    np.testing.assert_array_equal(placed.Lambda[:, 2], state.Lambda[:, 2])
    np.testing.assert_array_equal(Energy(centre=rest).completed(state).Lambda, state.Lambda)


def residuals(energy: Energy, scene: Scene, state: State) -> np.ndarray:
    """All residuals of the energy, point by point: written down once more, without statistics."""
    model = scene.model
    parts: list[np.ndarray] = []
    for w, h, M in zip(scene.W, scene.weights, state.matrices(), strict=True):
        rho = statistics.residuals(model.B, model.normalised(w), M, model.focal)
        parts.append(np.sqrt(h / POINTS) * rho)
    parts.append(np.sqrt(energy.rest) * (state.Lambda - energy.centre)[:, energy.rows])
    assert energy.edges is not None
    for Lambda in state.Lambda:
        d = energy.edges.rest + Lambda @ energy.edges.modes
        length = energy.edges.length
        parts.append(np.sqrt(energy.inextensibility / len(length)) * ((d**2).sum(axis=0) - length**2) / (2 * length))
    chain = join([scene.before.state, state]) if energy.tied else state
    for a, b in zip(range(len(chain) - 1), range(1, len(chain)), strict=True):
        sign = 1.0 if chain.q[a] @ chain.q[b] > 0 else -1.0
        parts.append(np.sqrt(energy.rotation) * (chain.q[b] - sign * chain.q[a]))
        parts.append(np.sqrt(energy.scale) * (chain.log_s[b] - chain.log_s[a]))
        change = (chain.Lambda[b] - chain.Lambda[a])[energy.rows, :]
        hold = scene.before.information if energy.tied and a == 0 else None
        parts.append(np.sqrt(energy.smoothness) * change if hold is None else np.linalg.cholesky(hold).T @ change.ravel())
    return np.concatenate([np.ravel(part) for part in parts])


def jacobian(of: Callable[[np.ndarray], np.ndarray], size: int) -> np.ndarray:
    h = 1e-6
    return np.stack([(of(h * e) - of(-h * e)) / (2 * h) for e in np.eye(size)], axis=1)


def dense(diagonal: np.ndarray, coupling: np.ndarray) -> np.ndarray:
    n, d, _ = diagonal.shape
    full = np.zeros((n, d, n, d))
    for i in range(n):
        full[i, :, i] = diagonal[i]
    for i in range(n - 1):
        full[i, :, i + 1], full[i + 1, :, i] = coupling[i], coupling[i].T
    return full.reshape(n * d, n * d)


@settings(max_examples=20)
@given(rng=SEEDS, camera=CAMERAS, rows=st.sampled_from([(0, 1, 2), (2,), (0, 1)]), tied=st.booleans(), known=st.booleans())
def test_blocks_are_those_of_the_residuals(rng, camera, rows, tied, known) -> None:  # type: ignore[no-untyped-def]
    scene = scene_of(rng, camera)
    if known:
        scene = held(scene, rng, rows)
    energy = everything(scene, rows, tied=tied)
    normal = linearise(energy, scene.data, scene.state, scene.before)
    n, d = normal.gradient.shape

    def moved(step: np.ndarray) -> np.ndarray:
        return residuals(energy, scene, scene.state.moved(step.reshape(n, d), rows))

    rho = moved(np.zeros(n * d))
    J = jacobian(moved, n * d)
    assert normal.value.sum() == pytest.approx(rho @ rho, rel=1e-9)
    np.testing.assert_allclose(normal.gradient.ravel(), J.T @ rho, rtol=1e-5, atol=1e-5)
    full = dense(normal.diagonal, normal.coupling)
    np.testing.assert_allclose(full, J.T @ J, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(full, full.T, atol=1e-10)


def test_fixed_scale_is_left_alone() -> None:
    rng = np.random.default_rng(5)
    scene = scene_of(rng)
    energy = replace(everything(scene, (0, 1, 2), tied=True), free_scale=False)
    normal = linearise(energy, scene.data, scene.state, scene.before)
    full = dense(normal.diagonal, normal.coupling) + 1e-6 * np.eye(normal.gradient.size)
    step = np.linalg.solve(full, normal.gradient.ravel()).reshape(normal.gradient.shape)
    np.testing.assert_array_equal(step[:, 5], 0.0)
    assert (step[:, 4] != 0).all()


def test_an_untied_window_floats() -> None:
    scene = scene_of(np.random.default_rng(6))
    tied = everything(scene, (0, 1, 2), tied=True)
    elsewhere = Previous(replace(scene.before.state, log_s=scene.before.state.log_s + 9.0))
    values = [evaluate(tied, scene.data, scene.state, b)[0] for b in (scene.before, elsewhere)]
    assert values[1] > values[0] + 1
    floating = replace(tied, tied=False)
    np.testing.assert_array_equal(
        evaluate(floating, scene.data, scene.state, scene.before), evaluate(floating, scene.data, scene.state, elsewhere)
    )
    np.testing.assert_array_equal(
        evaluate(tied, scene.data, scene.state, None), evaluate(floating, scene.data, scene.state, None)
    )


@given(SEEDS)
def test_hat_is_the_cross_product(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 3))
    np.testing.assert_allclose(np.tensordot(a, HAT, 1) @ b, np.cross(a, b))
