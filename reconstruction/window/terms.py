"""The terms of the energy (paper §5) and their derivatives, one function per term.

Every term is a sum of squares; it returns its value, half its gradient and the Gauss-Newton approximation of half its
Hessian, which is block tridiagonal over frames: smoothness couples neighbours, the other terms couple no frames.
"""

import numpy as np

from reconstruction.arrays import Array
from reconstruction.basis.constraints import ALL_ROWS, CoarseEdges
from reconstruction.state import POSE, State
from reconstruction.window import statistics
from reconstruction.window.energy import Energy
from reconstruction.window.marginal import Previous
from reconstruction.window.normal import Normal, diagonals
from reconstruction.window.smoothness import add_smoothness, add_smoothness_value
from reconstruction.window.statistics import Statistics

HAT = np.zeros((3, 3, 3))  # HAT[k] = [e_k]×
for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    HAT[i, k, j], HAT[i, j, k] = 1.0, -1.0
FORM = np.zeros((4, 3, 3))  # which rows of M each of the sums of `Statistics` is between
FORM[0, 0, 0] = FORM[0, 1, 1] = FORM[3, 2, 2] = 1.0
FORM[1, 0, 2] = FORM[1, 2, 0] = FORM[2, 1, 2] = FORM[2, 2, 1] = -1.0


def evaluate(energy: Energy, data: Statistics, state: State, before: Previous | None) -> Array:
    """Energy (n,) per frame; `before` is the frame that has left the window."""
    free = (state.Lambda - energy.centre)[:, energy.rows]
    value = statistics.value(data, state.matrices()) + (energy.rest * free**2).sum(axis=(1, 2))
    if energy.edges is not None:
        strain = energy.edges.strain(energy.edges.vectors(state.Lambda))
        value += energy.inextensibility * (strain**2).mean(axis=1)
    if energy.pull is not None:
        flat = free.reshape(len(state), -1)
        value += ((flat @ energy.pull.form) * flat).sum(axis=1)
    for weight, residual in energy.residuals:
        value += weight * (residual(state, energy.rows)[0] ** 2).sum(axis=1)
    add_smoothness_value(value, energy, state, before)
    return value


def linearise(
    energy: Energy, data: Statistics, state: State, before: Previous | None, value: Array | None = None
) -> Normal:
    """Value (n,), unless given, gradient and Gauss-Newton blocks of the whole energy at a state."""
    value = evaluate(energy, data, state, before) if value is None else value
    rows = energy.rows if energy.bending is None else ALL_ROWS
    normal = Normal.zero(value, POSE + len(rows) * state.Lambda.shape[2])
    add_data(normal, rows, data, state)
    if energy.edges is not None:
        add_inextensibility(normal, rows, energy.inextensibility, energy.edges, state)
    if energy.bending is not None:
        normal = by_row_tau(normal, energy.bending.slope(state.Lambda))
    add_rest(normal, energy, state)
    add_residuals(normal, energy, state)
    add_smoothness(normal, energy, state, before)
    if not energy.free_scale:
        normal.gradient[:, 5] = 0.0
        normal.diagonal[:, 5, :] = normal.diagonal[:, :, 5] = 0.0
        normal.diagonal[:, 5, 5] = 1.0
        normal.coupling[:, 5, :] = normal.coupling[:, :, 5] = 0.0
    return normal


def data_normal(data: Statistics, state: State) -> Normal:
    """The data term alone, all rows of Λ free."""
    normal = Normal.zero(np.zeros(len(state)), POSE + state.Lambda[0].size)
    add_data(normal, ALL_ROWS, data, state)
    return normal


def add_data(normal: Normal, free_rows: tuple[int, ...], data: Statistics, state: State) -> None:
    """Reprojection, quadratic in M: pose by the chain rule, Λ as a Kronecker product of AᵀA and the Υ part of the sums."""
    n, r = len(state), state.Lambda.shape[2]
    M = state.matrices()
    A = M[:, :, :3]
    ways = np.zeros((n, POSE + 1, 3, 4 + r))  # dM/d(θ, t, log s), and M itself
    ways[:, :3, :, :3] = turned = A[:, None] @ HAT
    ways[:, :3, :, 3:-1] = turned @ state.Lambda[:, None]
    ways[:, 3, 0, -1] = ways[:, 4, 1, -1] = 1.0
    ways[:, 5, :, :-1] = M[:, :, :-1]
    ways[:, 6] = M
    curved = statistics.apply(data, ways)
    slope, curved = curved[:, 6] - data.linear, curved[:, :6]
    flat = ways[:, :6].reshape(n, POSE, -1)
    normal.gradient[:, :POSE] += (flat @ slope.reshape(n, -1, 1))[:, :, 0]
    normal.diagonal[:, :POSE, :POSE] += flat @ curved.reshape(n, POSE, -1).transpose(0, 2, 1)
    if not free_rows or not r:
        return
    free = A if free_rows == ALL_ROWS else A[:, :, free_rows]
    across, rows = free.transpose(0, 2, 1), len(free_rows)
    normal.gradient[:, POSE:] += (across @ slope[:, :, 3:-1]).reshape(n, -1)
    mixed = (across[:, None] @ curved[:, :, :, 3:-1]).reshape(n, POSE, -1)
    normal.diagonal[:, :POSE, POSE:] += mixed
    normal.diagonal[:, POSE:, :POSE] += mixed.transpose(0, 2, 1)
    factors = (across[:, None] @ (FORM @ free[:, None])).reshape(n, 4, -1).transpose(0, 2, 1)
    by_rows = normal.diagonal[:, POSE:, POSE:].reshape(n, rows, r, rows, r)  # a view
    by_rows += (factors @ data.modes).reshape(n, rows, rows, r, r).transpose(0, 1, 3, 2, 4)


def by_row_tau(normal: Normal, slope: Array) -> Normal:
    """Normal equations in row τ alone, when all rows depend on it with slope (n, 3r, r): the chain rule."""
    n, d, r = len(slope), normal.gradient.shape[1], slope.shape[2]
    J = np.zeros((n, d, POSE + r))
    J[:, :POSE, :POSE] = np.eye(POSE)
    J[:, POSE:, POSE:] = slope
    Jt = J.transpose(0, 2, 1)
    gradient = (Jt @ normal.gradient[:, :, None])[:, :, 0]
    return Normal(normal.value, gradient, Jt @ normal.diagonal @ J, np.zeros((n - 1, POSE + r, POSE + r)))


def add_rest(normal: Normal, energy: Energy, state: State) -> None:
    """λ_0‖Λ' − Λ̄'‖²: the pull to the rest shape."""
    free = (state.Lambda - energy.centre)[:, energy.rows, :]
    weights = np.broadcast_to(energy.rest, free.shape).reshape(len(state), -1)
    normal.gradient[:, POSE:] += weights * free.reshape(len(state), -1)
    diagonals(normal.diagonal)[:, POSE:] += weights
    if energy.pull is not None:
        normal.gradient[:, POSE:] += free.reshape(len(state), -1) @ energy.pull.form
        normal.diagonal[:, POSE:, POSE:] += energy.pull.form


def add_residuals(normal: Normal, energy: Energy, state: State) -> None:
    """Priors that are given by their residuals."""
    for weight, residual in energy.residuals:
        r, J = residual(state, energy.rows)
        Jt = weight * J.transpose(0, 2, 1)
        normal.gradient += (Jt @ r[:, :, None])[:, :, 0]
        normal.diagonal += Jt @ J


def add_inextensibility(normal: Normal, free_rows: tuple[int, ...], kappa: float, edges: CoarseEdges, state: State) -> None:
    """κ mean_e ρ_e²: edges of the coarse mesh keep their rest length."""
    n, count = len(state), len(edges.length)
    vectors = edges.vectors(state.Lambda)
    strain = edges.strain(vectors)
    direction = (vectors / edges.length)[:, free_rows, None, :]
    J = (direction * edges.modes).reshape(n, -1, count)
    weight = kappa / count
    normal.gradient[:, POSE:] += weight * (J @ strain[:, :, None])[:, :, 0]
    normal.diagonal[:, POSE:, POSE:] += weight * (J @ J.transpose(0, 2, 1))
