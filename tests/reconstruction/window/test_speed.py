"""Times of the parts, by pytest-benchmark; and that no iteration touches the points."""

from time import process_time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from threadpoolctl import threadpool_limits

from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modes import modal_basis
from reconstruction.state import State
from reconstruction.window.energy import Energy, linearise
from reconstruction.window.solver import Solver, damped_step, minimise
from reconstruction.window.statistics import Statistics, frame_statistics, stack
from tests.reconstruction.world import relief

MODES, WINDOW, ROUNDS = 30, 5, 10


@pytest.fixture(autouse=True)
def one_core():  # type: ignore[no-untyped-def]
    with threadpool_limits(1):
        yield


def problem(p: int) -> tuple[Statistics, State]:
    """Sums of a window of frames that show noise, and a state far from explaining it; the basis is any."""
    rng = np.random.default_rng(0)
    basis = np.concatenate([rng.normal(size=(3 + MODES, p)), np.ones((1, p))])
    frames = [frame_statistics(basis, rng.normal(size=(2, p)), np.ones(p), 3.0) for _ in range(WINDOW)]
    q = np.tile([1.0, 0.0, 0.0, 0.0], (WINDOW, 1))
    return stack(frames), State(q, np.zeros((WINDOW, 2)), np.zeros(WINDOW), np.zeros((WINDOW, 3, MODES)))


def test_sums_of_a_frame(benchmark: BenchmarkFixture) -> None:
    rng = np.random.default_rng(0)
    basis, W = rng.normal(size=(4 + MODES, 828)), rng.normal(size=(2, 828))
    benchmark.pedantic(frame_statistics, (basis, W, np.ones(828), 3.0), rounds=ROUNDS, warmup_rounds=1)


def test_linearisation_of_a_window(benchmark: BenchmarkFixture) -> None:
    data, state = problem(828)
    benchmark.pedantic(linearise, (Energy(), data, state, None), rounds=ROUNDS, warmup_rounds=1)


def test_step_of_a_window(benchmark: BenchmarkFixture) -> None:
    data, state = problem(828)
    normal = linearise(Energy(), data, state, None)
    step = benchmark.pedantic(damped_step, (normal, 1e-4), rounds=ROUNDS, warmup_rounds=1)
    assert np.isfinite(step).all()


@pytest.mark.parametrize("metric", ["euclidean", "manhattan"])
def test_basis(benchmark: BenchmarkFixture, metric: str) -> None:
    rest = relief(np.random.default_rng(0), 594)
    mesh = triangulate(rest[:2].T)
    benchmark.pedantic(modal_basis, (rest, mesh, MODES, metric), rounds=3)


def test_iterations_do_not_touch_the_points() -> None:
    least = {}
    solver = Solver(iterations=3, tolerance=0.0)
    problems = {p: problem(p) for p in (100, 20_000)}
    for _ in range(10):
        for p, (data, state) in problems.items():
            started = process_time()
            minimise(Energy(), data, state, None, solver)
            least[p] = min(least.get(p, np.inf), process_time() - started)
    assert least[20_000] < 1.5 * least[100]
