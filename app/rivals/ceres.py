"""The window step by Ceres through pyceres: all points of a frame in one block of residuals, analytic Jacobians."""

from dataclasses import dataclass
from time import process_time

import numpy as np
import pyceres

from app.arrays import Array
from app.rivals.problems import WindowStep
from app.rivals.residuals import FrameData, change_weights, parameters, rest_weights


@dataclass(frozen=True)
class Solved:
    """Where Ceres ended, and how long it took without making the problem."""

    energy: float
    milliseconds: float


class Reprojection(pyceres.CostFunction):  # type: ignore[misc]
    """All points of one frame."""

    def __init__(self, frame: FrameData) -> None:
        super().__init__()
        self._frame = frame
        self.set_num_residuals(2 * frame.step.points)
        self.set_parameter_block_sizes([4, 2, 1, len(rest_weights(frame.step))])

    def Evaluate(self, parameters: list[Array], residuals: Array, jacobians: list[Array] | None) -> bool:
        """What Ceres calls."""
        q, t, log_s, free = parameters
        residuals[:] = self._frame.residual(q, t, log_s[0], free)
        if jacobians is not None:
            of_q, of_t, of_log_s, of_free = (slope.reshape(len(residuals), -1) for slope in jacobians)
            self._frame.derivatives(q, log_s[0], free, out=(of_q, of_t, of_log_s, of_free))
        return True


class CeresWindow:
    """A window step as Ceres wants it: four blocks of parameters per frame; the small terms are Ceres' own, in C++."""

    def __init__(self, step: WindowStep) -> None:
        self._step = step
        self._frames = [FrameData(step, W) for W in step.W]

    def solve(self, tolerance: float) -> Solved:
        """Where Ceres ends; one thread, as all."""
        problem = self._problem()
        options = pyceres.SolverOptions()
        options.linear_solver_type = pyceres.LinearSolverType.SPARSE_NORMAL_CHOLESKY  # three times as fast as the dense one
        options.function_tolerance = tolerance
        options.parameter_tolerance = options.gradient_tolerance = 0.0
        options.max_num_iterations = 100
        options.num_threads = 1
        options.logging_type = pyceres.LoggingType.SILENT
        summary = pyceres.SolverSummary()
        started = process_time()
        pyceres.solve(options, problem, summary)
        return Solved(2.0 * float(summary.final_cost), 1e3 * (process_time() - started))

    def _problem(self) -> pyceres.Problem:
        step, rows = self._step, self._step.energy.rows
        every = parameters(step.start, rows)
        before = parameters(step.before, rows)[0]
        if before[:4] @ every[0, :4] < 0:
            before[:4] *= -1
        problem = pyceres.Problem()
        change = [variances(w) for w in blocks(change_weights(step))]
        rest = variances(rest_weights(step))
        earlier: list[Array] = []
        for frame, start in zip(self._frames, every, strict=True):
            now = [block.copy() for block in blocks(start)]
            problem.add_residual_block(Reprojection(frame), None, now)
            problem.set_manifold(now[0], pyceres.QuaternionManifold())
            problem.add_residual_block(pyceres.factors.NormalPrior(np.zeros(len(rest)), rest), None, now[3:])
            for i, variance in enumerate(change):
                if not np.isfinite(variance).all():
                    continue  # weight 0
                if earlier:
                    problem.add_residual_block(pyceres.factors.NormalError(variance), None, [now[i], earlier[i]])
                else:
                    tie = pyceres.factors.NormalPrior(blocks(before)[i], variance)
                    problem.add_residual_block(tie, None, [now[i]])
            earlier = now
        return problem


def blocks(vector: Array) -> list[Array]:
    """q, t, log s and Λ' of a vector (7 + k,)."""
    return np.split(vector, [4, 6, 7])


def variances(roots: Array) -> Array:
    """Diagonal covariance whose inverse has these roots of weights."""
    with np.errstate(divide="ignore"):
        inverse = 1 / roots**2
    return np.diag(inverse) if np.isfinite(inverse).all() else inverse
