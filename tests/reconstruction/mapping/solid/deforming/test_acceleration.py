"""Where rounds lead to: to the end of those that shrink evenly, and never out of bounds."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.arrays import Array
from reconstruction.basis.constraints import ALL_ROWS
from reconstruction.mapping.solid.deforming.acceleration import CHANGED, LONGEST, extrapolated, step
from reconstruction.mapping.solid.deforming.deformations import Deformations, Learned
from reconstruction.state import POSE, State
from tests.reconstruction.world import SEEDS

K, R, P = 4, 3, 7


def some(rng: np.random.Generator) -> tuple[Learned, Array, Array, Array]:
    """What was learned, and a change of its rest shape, its state and its covariance."""
    q = rng.normal(size=(K, 4))
    state = State(
        q / np.linalg.norm(q, axis=1, keepdims=True),
        rng.normal(size=(K, 2)),
        rng.normal(size=K),
        rng.normal(size=(K, 3, R)),
    )
    root = rng.normal(size=(3 * R, 3 * R))
    covariance = root @ root.T + np.eye(3 * R)
    change = rng.normal(size=(3 * R, 3 * R))
    learned = Learned(rng.normal(size=(4 + R, P)), state, Deformations(covariance, 0.01))
    return learned, rng.normal(size=(3, P)), 0.1 * rng.normal(size=(K, POSE + 3 * R)), 0.02 * (change + change.T)


def beside(end: Learned, by: float, shape: Array, moved: Array, covariance: Array) -> Learned:
    """So many times those changes away."""
    B = np.concatenate([end.B[:3] + by * shape, end.B[3:]])
    known = Deformations(end.deformations.covariance + by * covariance, 0.01)
    return Learned(B, end.state.moved(by * moved, ALL_ROWS), known)


@settings(max_examples=20)
@given(rng=SEEDS, rate=st.floats(0.3, 1 - 1 / LONGEST))
def test_rounds_that_shrink_evenly_end_where_they_lead_to(rng: np.random.Generator, rate: float) -> None:
    end, *changes = some(rng)
    path = [beside(end, by, *changes) for by in (1.0, rate, rate**2)]
    found = extrapolated(*path)
    np.testing.assert_allclose(found.B, end.B, atol=1e-9)
    np.testing.assert_allclose(found.deformations.covariance, end.deformations.covariance, atol=1e-9)
    left = np.abs(step(found.state, end.state))
    assert left[:, 3:].max() < 1e-9
    assert left[:, :3].max() < 0.05 * np.abs(step(path[2].state, end.state))[:, :3].max() + 1e-6  # turns do not add up


@settings(max_examples=20)
@given(rng=SEEDS, by=st.floats(0.01, 10))
def test_no_variance_changes_out_of_bounds(rng: np.random.Generator, by: float) -> None:
    end, shape, moved, _ = some(rng)
    growing = end.deformations.covariance / 100
    path = [beside(end, k * by, shape, moved, growing) for k in (0.0, 1.0, 1.9)]
    found = extrapolated(*path).deformations.covariance
    times = np.linalg.eigvals(np.linalg.solve(path[2].deformations.covariance, found)).real
    assert times.min() > CHANGED[0] - 1e-6
    assert times.max() < CHANGED[1] + 1e-6


@given(rng=SEEDS)
def test_a_step_leads_from_one_state_to_the_other(rng: np.random.Generator) -> None:
    learned, _, moved, _ = some(rng)
    to = learned.state.moved(moved, ALL_ROWS)
    again = learned.state.moved(step(learned.state, to), ALL_ROWS)
    np.testing.assert_allclose(again.matrices(), to.matrices(), atol=1e-9)
