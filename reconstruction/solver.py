"""Levenberg-Marquardt over a sliding window of frames (paper §5), with block tridiagonal normal equations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.linalg.blas import dsyrk, dtrsm
from scipy.linalg.lapack import dpotrf

from reconstruction.energy import Energy, Normal, State, evaluate, linearise
from reconstruction.statistics import Statistics

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Solver:
    """Levenberg-Marquardt settings."""

    iterations: int = 25
    """Most steps tried."""
    tolerance: float = 1e-3
    """Stop when a step lowers the energy by less than this share of it."""
    damping: float = 1e-4
    """First damping, relative to the diagonal of the normal matrix."""


@dataclass(frozen=True)
class Solution:
    """Where the minimisation ended.

    Attributes:
        state: the window's frames.
        value: (n,) energy per frame.
        steps: steps tried.
    """

    state: State
    value: Array
    steps: int


def minimise(energy: Energy, data: Statistics, start: State, before: State | None, solver: Solver) -> Solution:
    """Minimise the energy of a window from `start`; `before` is the frame that has left it."""
    state, damping, steps = start, solver.damping, 0
    normal = linearise(energy, data, state, before)
    while steps < solver.iterations:
        steps += 1
        trial = state.moved(damped_step(normal, damping), energy.rows)
        value = evaluate(energy, data, trial, before)
        gain = normal.value.sum() - value.sum()
        if not gain > 0:  # also when not finite
            if damping > 1e8 or abs(gain) <= 1e-14 * normal.value.sum():
                break
            damping *= 10
            continue
        settled = gain <= solver.tolerance * normal.value.sum()
        state, damping = trial, max(damping / 10, 1e-9)
        if settled:
            return Solution(state, value, steps)
        normal = linearise(energy, data, state, before)
    return Solution(state, normal.value, steps)


def damped_step(normal: Normal, damping: float) -> Array:
    """Marquardt's step (n, d): the diagonal raised by a share of itself."""
    diagonal = normal.diagonal.copy()
    index = np.arange(diagonal.shape[1])
    scale = diagonal[:, index, index]
    diagonal[:, index, index] += damping * scale + 1e-10 * (1 + scale.max())
    try:
        return -solve_block_tridiagonal(diagonal, normal.coupling, normal.gradient)
    except LinAlgError:
        return np.full_like(normal.gradient, np.nan)


def solve_block_tridiagonal(diagonal: Array, coupling: Array, right: Array) -> Array:
    """Solve the symmetric positive definite block tridiagonal system by block Cholesky, O(n d³).

    Args:
        diagonal: (n, d, d) diagonal blocks.
        coupling: (n-1, d, d) blocks above the diagonal.
        right: (n, d).

    Raises:
        LinAlgError: the matrix is not positive definite.
    """
    n = len(diagonal)
    factors: list[Array] = []
    links: list[Array] = []  # L_i⁻¹ U_i
    y = np.empty_like(right)
    for i in range(n):
        block, b = diagonal[i], right[i]
        if i:
            block = block - dsyrk(1.0, links[-1], trans=1, lower=1)
            b = b - links[-1].T @ y[i - 1]
        factor, failed = dpotrf(block, lower=1, clean=0)
        if failed:
            raise LinAlgError("not positive definite")
        factors.append(factor)
        y[i] = dtrsm(1.0, factor, b[:, None], lower=1)[:, 0]
        if i < n - 1:
            links.append(dtrsm(1.0, factor, coupling[i], lower=1))
    x = np.empty_like(right)
    for i in range(n - 1, -1, -1):
        b = y[i] - links[i] @ x[i + 1] if i < n - 1 else y[i]
        x[i] = dtrsm(1.0, factors[i], b[:, None], lower=1, trans_a=1)[:, 0]
    return x
