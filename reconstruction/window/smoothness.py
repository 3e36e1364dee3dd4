"""The terms of the energy that couple neighbouring frames (paper §5): rotation, scale and deformation change slowly."""

import numpy as np

from reconstruction.arrays import Array
from reconstruction.camera import left_matrix
from reconstruction.state import POSE, State, join
from reconstruction.window.energy import Energy
from reconstruction.window.marginal import Previous
from reconstruction.window.normal import Normal, diagonals


def neighbours(energy: Energy, state: State, before: Previous | None) -> tuple[State, State, Array | None]:
    """Frames and their successors, the frame before the window among them if it is tied, and what that one knows of Λ'."""
    if before is None or not energy.tied:
        return state[:-1], state[1:], None
    earlier = join([before.state, state[:-1]]) if len(state) > 1 else before.state
    return earlier, state, before.information


def add_smoothness_value(value: Array, energy: Energy, state: State, before: Previous | None) -> None:
    """Add to the value (n,) of each frame the cost of its change since the frame before."""
    earlier, later, information = neighbours(energy, state, before)
    if len(later):
        value[len(state) - len(later) :] += smoothness(energy, earlier, later, information)


def smoothness(energy: Energy, earlier: State, later: State, information: Array | None = None) -> Array:
    """Change (n,) between frames and their successors: λ_q‖Δq‖² + λ_s(Δ log s)² + that of Λ' (`deformation_change`).

    With `information` H (k, k) the latter is ΔΛ'ᵀ H ΔΛ' for the first of them.
    """
    change, cost, _ = deformation_change(energy, earlier, later)
    if information is not None:
        cost[0] = change[0] @ information @ change[0]
    return (
        energy.rotation * (quaternion_difference(earlier.q, later.q) ** 2).sum(axis=1)
        + energy.scale * (later.log_s - earlier.log_s) ** 2
        + cost
    )


def deformation_change(energy: Energy, earlier: State, later: State) -> tuple[Array, Array, Array]:
    """Change ΔΛ' (n, k) of the free rows between successive frames, its cost (n,), weights on its squares (n or 1, k).

    The cost is c = λ_γ‖ΔΛ'‖², or j log(1 + c/j) with jumps of size j, as of a heavy-tailed distribution.
    """
    change = (later.Lambda - earlier.Lambda)[:, energy.rows, :]
    weights = energy.smoothness * np.ones(change.shape[1:])
    change, weights = change.reshape(len(change), weights.size), weights.reshape(1, weights.size)
    cost = (weights * change**2).sum(axis=1)
    if energy.jump is not None:
        weights = weights / (1 + cost / energy.jump)[:, None]
        cost = energy.jump * np.log1p(cost / energy.jump)
    return change, cost, weights


def quaternion_difference(earlier: Array, later: Array) -> Array:
    """Δq (n, 4) with the sign of `earlier` that is nearer: q and −q are the same rotation."""
    nearer = np.where((earlier * later).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    return later - nearer * earlier


def quaternion_tangent(q: Array) -> Array:
    """dq/dθ (n, 4, 3) of q ⊗ exp(θ/2) at θ = 0."""
    return 0.5 * left_matrix(q)[..., 1:]


def add_smoothness(normal: Normal, energy: Energy, state: State, before: Previous | None) -> None:
    """Differences of neighbours inside the window, and of the oldest frame to the one that has left it.

    Quaternions are at right angles to their tangents, whose columns are a half long each.
    """
    earlier, later, information = neighbours(energy, state, before)
    n, d = len(later), normal.gradient.shape[1]
    if n == 0:
        return
    nearer = np.where((earlier.q * later.q).sum(axis=1) < 0, -energy.rotation, energy.rotation)[:, None, None]
    before_turned, turned = quaternion_tangent(earlier.q), nearer * quaternion_tangent(later.q)
    change, weights = np.zeros((n, d)), np.zeros((n, d))
    weights[:, :3] = energy.rotation / 4
    change[:, 5], weights[:, 5] = later.log_s - earlier.log_s, energy.scale
    change[:, POSE:], _, weights[:, POSE:] = deformation_change(energy, earlier, later)
    if information is not None:
        weights[0, POSE:] = 0.0
        normal.gradient[0, POSE:] += information @ change[0, POSE:]
        normal.diagonal[0, POSE:, POSE:] += information
    inner = slice(n + 1 - len(state), n)  # the others tie frames of the window to each other
    pulled, along = weights * change, diagonals(normal.diagonal)
    pulled[:, :3] = -(earlier.q[:, None] @ turned)[:, 0]
    normal.gradient[len(state) - n :] += pulled
    along[len(state) - n :] += weights
    pulled[:, :3] = (later.q[:, None] @ (nearer * before_turned))[:, 0]
    normal.gradient[:-1] -= pulled[inner]
    along[:-1] += weights[inner]
    normal.coupling[:, :3, :3] -= before_turned[inner].transpose(0, 2, 1) @ turned[inner]
    diagonals(normal.coupling)[:, 5:] -= weights[inner, 5:]
