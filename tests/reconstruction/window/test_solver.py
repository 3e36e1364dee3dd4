"""The solver: block tridiagonal systems, and Levenberg-Marquardt over a window."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import LinAlgError

from reconstruction.camera import Camera, quaternion_exp, quaternion_from_rotation, quaternion_product
from reconstruction.state import State
from reconstruction.window import solver
from reconstruction.window.energy import Energy
from reconstruction.window.solver import Solver, banded, minimise, solve_banded
from reconstruction.window.terms import evaluate
from tests.reconstruction.world import CAMERAS, SEEDS, model_of, relief, seen, shape_error, statistics_of, turns


@given(SEEDS, st.integers(1, 6), st.integers(1, 9))
def test_block_solve_is_the_dense_solve(rng: np.random.Generator, n: int, d: int) -> None:
    L = np.tril(rng.normal(size=(n * d, n * d)))
    for i in range(n):  # a bidiagonal factor: its square is block tridiagonal
        L[i * d : (i + 1) * d, : max(0, i - 1) * d] = 0.0
    L[np.diag_indices(n * d)] = 1.0 + rng.random(n * d)
    full = (L @ L.T).reshape(n, d, n, d)
    diagonal = np.stack([full[i, :, i] for i in range(n)])
    coupling = np.stack([full[i, :, i + 1] for i in range(n - 1)]) if n > 1 else np.zeros((0, d, d))
    right = rng.normal(size=(n, d))
    x = solve_banded(banded(diagonal, coupling), right)
    np.testing.assert_allclose(full.reshape(n * d, n * d) @ x.ravel(), right.ravel(), atol=1e-7 * (1 + np.abs(x).max()))


@given(SEEDS, st.integers(0, 4))
def test_the_band_is_as_wide_as_the_coupling_reaches(rng: np.random.Generator, reach: int) -> None:
    n, d = 3, 5
    blocks = rng.normal(size=(n, d, d))
    diagonal = blocks + blocks.transpose(0, 2, 1)
    coupling = np.stack([np.diag(rng.random(d - reach), reach)] * (n - 1))
    band = banded(diagonal, coupling)
    assert band.shape == (n * d, d + 1 + reach)
    full = np.zeros((n * d, n * d))
    for offset in range(band.shape[1]):
        full += np.diag(band[: n * d - offset, offset], -offset)
    full = (full + np.tril(full, -1).T).reshape(n, d, n, d)
    np.testing.assert_array_equal(np.stack([full[i, :, i] for i in range(n)]), diagonal)
    np.testing.assert_array_equal(np.stack([full[i, :, i + 1] for i in range(n - 1)]), coupling)
    np.testing.assert_array_equal(full[0, :, 2], 0.0)


def test_indefinite_systems_are_refused() -> None:
    with pytest.raises(LinAlgError):
        solve_banded(banded(np.stack([np.eye(2), -np.eye(2)]), np.zeros((1, 2, 2))), np.ones((2, 2)))


def scene(rng: np.random.Generator, camera: Camera, frames: int = 5, modes: int = 4):  # type: ignore[no-untyped-def]
    """A model, what a deformed shape that turns looks like, the state that explains it, and its true shape."""
    model = model_of(relief(rng, 50), camera, modes)
    Lambda = 0.08 * rng.normal(size=(3, modes)) * model.unit
    shape = model.basis.deform(Lambda)
    R = turns(frames, 40.0)
    W, _ = seen(np.broadcast_to(shape, (frames, *shape.shape)), R, camera)
    q = np.stack([quaternion_from_rotation(r @ model.basis.Phi) for r in R])
    Lambdas = np.broadcast_to(Lambda / model.unit, (frames, 3, modes)).copy()
    true = State(q, np.zeros((frames, 2)), np.zeros(frames), Lambdas)
    return model, statistics_of(model, W, np.ones((frames, 50))), true, shape


STIFF = Energy(rotation=1e-9, scale=1e-9, smoothness=1.0, rest=1e-9, tied=False)


def disturbed(rng: np.random.Generator, state: State, radians: float = 0.1) -> State:
    """The rest shape, poses a little off."""
    q = quaternion_product(state.q, quaternion_exp(radians * rng.normal(size=(len(state), 3))))
    return replace(state, q=q, t=state.t + 0.05 * rng.normal(size=state.t.shape), Lambda=np.zeros_like(state.Lambda))


@settings(max_examples=15)
@given(rng=SEEDS, camera=CAMERAS)
def test_every_step_lowers_the_energy(rng: np.random.Generator, camera: Camera) -> None:
    _, data, true, _ = scene(rng, camera)
    start = disturbed(rng, true, 0.5)
    energy = Energy()
    values = [evaluate(energy, data, start, None).sum()]
    for iterations in range(1, 9):
        solution = minimise(energy, data, start, None, Solver(iterations=iterations, tolerance=0.0))
        assert solution.steps <= iterations
        np.testing.assert_allclose(solution.value, evaluate(energy, data, solution.state, None), rtol=1e-9)
        values.append(solution.value.sum())
    assert (np.diff(values) <= 1e-12).all()
    assert values[-1] < values[0]


@settings(max_examples=15)
@given(rng=SEEDS, camera=CAMERAS)
def test_a_deformation_seen_from_several_sides_is_recovered(rng: np.random.Generator, camera: Camera) -> None:
    model, data, true, shape = scene(rng, camera)
    assert evaluate(STIFF, data, true, None).sum() < 1e-6
    solution = minimise(STIFF, data, disturbed(rng, true), None, Solver(iterations=100, tolerance=1e-9))
    found = model.basis.deform(solution.state.Lambda * model.unit)
    static = shape_error(model.basis.rest, shape)
    assert max(shape_error(f, shape) for f in found) < 0.05 * static


def test_minimising_at_the_minimum_stays_there() -> None:
    rng = np.random.default_rng(1)
    _, data, true, _ = scene(rng, Camera(500.0, np.array([320.0, 240.0])))
    first = minimise(STIFF, data, true, None, Solver(iterations=50, tolerance=0.0))
    again = minimise(STIFF, data, first.state, None, Solver())
    assert again.value.sum() <= first.value.sum()
    np.testing.assert_allclose(again.state.matrices(), first.state.matrices(), atol=1e-4)


def test_a_start_that_is_not_finite_ends() -> None:
    rng = np.random.default_rng(2)
    _, data, true, _ = scene(rng, Camera())
    broken = replace(true, t=np.full_like(true.t, np.nan))
    assert minimise(Energy(), data, broken, None, Solver()).steps <= Solver().iterations


@pytest.mark.filterwarnings("error")
def test_steps_too_far_are_not_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    _, data, true, _ = scene(rng, Camera(500.0, np.array([320.0, 240.0])))
    start, real = disturbed(rng, true), solver.damped_step
    monkeypatch.setattr(solver, "damped_step", lambda normal, damping: real(normal, damping) + 1e4 * (damping < 1.0))
    end = minimise(Energy(), data, start, None, Solver())
    assert end.value.sum() < evaluate(Energy(), data, start, None).sum()


@pytest.mark.parametrize("rows", [(2,), (0, 1)])
def test_fixed_rows_stay(rows: tuple[int, ...]) -> None:
    rng = np.random.default_rng(3)
    _, data, true, _ = scene(rng, Camera())
    end = minimise(Energy(rows=rows), data, disturbed(rng, true), None, Solver()).state
    fixed = [row for row in range(3) if row not in rows]
    np.testing.assert_array_equal(end.Lambda[:, fixed], 0.0)
    assert np.abs(end.Lambda[:, rows]).max() > 1e-3
