"""SciPy minimises the solver's energy."""

import numpy as np
import pytest

from app.bench import window
from app.rivals import problems
from app.rivals.problems import WindowStep, full_model, summed, window_step
from app.rivals.residuals import parameters
from app.rivals.scipy_rival import ScipyWindow, exponential, exponential_slope
from reconstruction.camera import quaternion_exp
from reconstruction.window.marginal import Previous
from reconstruction.window.solver import Solver
from reconstruction.window.statistics import stack
from reconstruction.window.terms import evaluate


@pytest.mark.parametrize("deformation", window.DEFORMATIONS)
def test_scipy_minimises_the_energy_of_the_solver(deformation: str) -> None:
    step = window_step(full_model(60), 5, deformation)
    data = stack([step.earlier, summed(step.B, step.W[-1], step.focal)])
    scipy = ScipyWindow(step)
    x = np.concatenate([np.zeros((problems.WINDOW, 3)), parameters(step.start, step.energy.rows)[:, 4:]], axis=1).ravel()
    ours = evaluate(step.energy, data, step.start, Previous(step.before)).sum()
    assert (scipy.residuals(x) ** 2).sum() == pytest.approx(ours, rel=1e-9)
    end = window.solved(step, Solver(iterations=100, tolerance=1e-12)).value.sum()
    assert scipy.solve(1e-12) == pytest.approx(end, rel=1e-6)
    assert end < 0.9 * ours


def test_its_jacobian_is_the_derivative(step: WindowStep) -> None:
    scipy, rng = ScipyWindow(step), np.random.default_rng(0)
    n = problems.WINDOW
    x = np.concatenate([np.zeros((n, 3)), parameters(step.start, step.energy.rows)[:, 4:]], axis=1).ravel()
    x = x + 0.05 * rng.normal(size=x.size)
    direction = 1e-5 * rng.normal(size=x.size)
    difference = (scipy.residuals(x + direction) - scipy.residuals(x - direction)) / 2
    np.testing.assert_allclose(scipy.jacobian(x) @ direction, difference, atol=1e-8 * np.abs(difference).max())


def test_turning_by_nothing_and_by_much() -> None:
    theta = np.array([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0], [0.4, -0.3, 1.0]])
    np.testing.assert_allclose(exponential(theta), quaternion_exp(theta), atol=1e-15)
    for k, step in enumerate(1e-6 * np.eye(3)):
        slope = (exponential(theta + step) - exponential(theta - step)) / 2e-6
        np.testing.assert_allclose(exponential_slope(theta)[:, :, k], slope, atol=1e-9)
