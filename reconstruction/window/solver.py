"""Levenberg-Marquardt over a sliding window of frames (paper §5), with block tridiagonal normal equations."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import as_strided
from scipy.linalg import LinAlgError
from scipy.linalg.lapack import dpbsv

from reconstruction.arrays import Array
from reconstruction.state import State
from reconstruction.window.energy import Energy
from reconstruction.window.marginal import Previous
from reconstruction.window.normal import Normal
from reconstruction.window.statistics import Statistics
from reconstruction.window.terms import evaluate, linearise


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


def minimise(energy: Energy, data: Statistics, start: State, before: Previous | None, solver: Solver) -> Solution:
    """Minimise the energy of a window from `start`; `before` is the frame that has left it."""
    state, damping, steps = energy.completed(start), solver.damping, 0
    before = before and replace(before, state=energy.completed(before.state))
    normal = linearise(energy, data, state, before)
    value = normal.value
    while steps < solver.iterations:
        steps += 1
        with np.errstate(over="ignore", invalid="ignore"):  # of steps too far, which are not taken
            trial = energy.completed(state.moved(damped_step(normal, damping), energy.rows))
            tried = evaluate(energy, data, trial, before)
        gain = value.sum() - tried.sum()
        if not gain > 0:  # also when not finite
            if damping > 1e8 or abs(gain) <= 1e-14 * value.sum():
                break
            damping *= 10
            continue
        enough = gain <= solver.tolerance * value.sum()
        state, value, damping = trial, tried, max(damping / 10, 1e-9)
        if enough or steps == solver.iterations:
            break
        normal = linearise(energy, data, state, before, value)
    return Solution(state, value, steps)


def one_step(energy: Energy, data: Statistics, start: State) -> State:
    """One Gauss-Newton step of a single frame, tied to no other: enough where `start` is near the minimum."""
    normal = linearise(energy, data, start, None, np.zeros(1))
    return start.moved(damped_step(normal, 0.0), energy.rows)


def damped_step(normal: Normal, damping: float) -> Array:
    """Marquardt's step (n, d): the diagonal raised by a share of itself."""
    band = banded(normal.diagonal, normal.coupling)
    scale = band[:, 0].reshape(normal.gradient.shape)
    scale += damping * scale + 1e-10 * (1 + scale.max())
    try:
        return -solve_banded(band, normal.gradient)
    except LinAlgError:
        return np.full_like(normal.gradient, np.nan)


def banded(diagonal: Array, coupling: Array) -> Array:
    """The lower band of a symmetric block tridiagonal matrix: row j holds column j from the diagonal downwards.

    Neighbours couple θ with θ and every other parameter with itself, so the band is hardly wider than one block; a
    Cholesky factor within it takes half the work of one by blocks, O(n d³).

    Args:
        diagonal: (n, d, d) diagonal blocks.
        coupling: (n-1, d, d) blocks above the diagonal.

    Returns:
        (n d, width).
    """
    n, d, _ = diagonal.shape
    linked = np.flatnonzero(coupling.any(axis=0)) if n > 1 else np.empty(0, np.int64)
    a, b = np.divmod(linked, d)
    width = d + 1 + int((b - a).max(initial=0))
    band = np.zeros((n, d * width))
    # Within a block, (row j, column i >= j) is at j * width + i - j: rows one shorter than the band's; none overlap.
    frame, number = band.strides
    block = as_strided(band, (n, d, d), (frame, (width - 1) * number, number))
    np.multiply(diagonal, upper_triangle(d), out=block)
    band[:-1, d + b - a + a * width] = coupling.reshape(n - 1, d * d)[:, linked]
    return band.reshape(n * d, width)


@lru_cache
def upper_triangle(d: int) -> Array:
    """Ones on and above the diagonal (d, d), zeros below."""
    return np.triu(np.ones((d, d)))


def solve_banded(band: Array, right: Array) -> Array:
    """Solve the positive definite system with this lower band, which is overwritten; right (n, d).

    Raises:
        LinAlgError: the matrix is not positive definite.
    """
    _, x, failed = dpbsv(band.T, right.ravel(), lower=1, overwrite_ab=1)
    if failed:
        raise LinAlgError("not positive definite")
    return x.reshape(right.shape)
