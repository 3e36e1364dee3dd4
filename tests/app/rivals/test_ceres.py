"""Ceres minimises the solver's energy."""

import pytest

from app.bench import window
from app.rivals.problems import WindowStep
from reconstruction.window.solver import Solver


def test_ceres_minimises_the_energy_of_the_solver(step: WindowStep) -> None:
    pytest.importorskip("pyceres", reason="pyceres is not installed: pip install 'modeshape[bench]'")
    from app.rivals.ceres import CeresWindow

    end = window.solved(step, Solver(iterations=100, tolerance=1e-12)).value.sum()
    found = CeresWindow(step).solve(1e-12)
    assert found.energy == pytest.approx(end, rel=1e-6)
    assert found.milliseconds > 0
