"""The energy of the on-line bundle adjustment (paper §5) and its derivatives, one function per term.

Every term is a sum of squares; it returns its value, half its gradient and the Gauss-Newton approximation of half its
Hessian, which is block tridiagonal over frames: the data and the priors couple nothing, smoothness couples neighbours.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.camera import left_matrix
from reconstruction.state import POSE, State, join
from reconstruction.window import statistics
from reconstruction.window.edges import Bending, CoarseEdges
from reconstruction.window.marginal import Past
from reconstruction.window.statistics import Statistics

Array = NDArray[np.float64]

ALL_ROWS = (0, 1, 2)
HAT = np.zeros((3, 3, 3))  # HAT[k] = [e_k]×
for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    HAT[i, k, j], HAT[i, j, k] = 1.0, -1.0


@dataclass(frozen=True)
class Energy:
    """Weights of the terms; each multiplies a sum of squares of dimensionless quantities (`priors` says which when).

    Attributes:
        rotation: λ_q on ‖Δq‖² between neighbouring frames.
        translation: λ_t on ‖Δt‖².
        scale: λ_s on (Δ log s)².
        smoothness: λ_γ on ‖ΔΛ'‖²; (r,) where each mode has its own.
        jump: what smoothness adds up to where a change passes for a jump, from which on it costs ever less more.
        rest: λ_0 on ‖Λ' − Λ̄'‖², the pull to the rest shape; (r,) where each mode has its own.
        centre: Λ̄' (3, r), the rest shape as refined meanwhile.
        inextensibility: κ on the mean squared edge strain term of `edges`.
        rows: rows of Λ that are estimated (§3.4): 0 and 1 stretch in the plane, 2 bends out of it.
        free_scale: whether s is estimated; the paper's energy keeps s = 1.
        tied: whether the oldest frame is tied to the frame that has left the window; without, the window floats.
        edges: coarse edges of the inextensibility term.
        bending: rows of Λ that are not free follow from row τ, for a sheet that keeps its lengths; else they stay at rest.
    """

    rotation: float = 3e-4
    translation: float = 0.0
    scale: float = 1e-3
    smoothness: float | Array = 1e-2
    jump: float = np.inf
    rest: float | Array = 1e-2
    centre: float | Array = 0.0
    inextensibility: float = 0.0
    rows: tuple[int, ...] = ALL_ROWS
    free_scale: bool = True
    tied: bool = True
    edges: CoarseEdges | None = None
    bending: Bending | None = None

    def about(self, centre: Array) -> "Energy":
        """The same energy about a rest shape refined to Λ̄' (3, r): what it pulls to, and which lengths edges keep."""
        edges = self.edges and self.edges.about(centre)
        return replace(self, centre=centre, edges=edges, bending=self.bending and self.bending.about(centre))

    def completed(self, state: State) -> State:
        """The state with the rows of Λ' that are not free as they must be."""
        if self.rows == ALL_ROWS:
            return state
        Lambda = np.broadcast_to(self.centre, state.Lambda.shape).copy()
        Lambda[:, self.rows] = state.Lambda[:, self.rows]
        return replace(state, Lambda=Lambda if self.bending is None else self.bending.completed(Lambda))

    def rigid(self) -> "Energy":
        """The same energy with nothing deforming: pose only."""
        return replace(self, rows=(), edges=None, inextensibility=0.0, bending=None)


@dataclass
class Normal:
    """Value of an energy and its block tridiagonal normal equations.

    Attributes:
        value: (n,) energy per frame; smoothness counts for the later frame.
        gradient: (n, d) half the gradient.
        diagonal: (n, d, d) diagonal blocks of half the Gauss-Newton Hessian.
        coupling: (n-1, d, d) blocks between frame i (rows) and i+1 (columns).
    """

    value: Array
    gradient: Array
    diagonal: Array
    coupling: Array


def evaluate(energy: Energy, data: Statistics, state: State, before: Past | None) -> Array:
    """Energy (n,) per frame; `before` is the frame that has left the window."""
    free = (state.Lambda - energy.centre)[:, energy.rows]
    value = statistics.value(data, state.matrices()) + (energy.rest * free**2).sum(axis=(1, 2))
    if energy.edges is not None:
        strain = energy.edges.strain(energy.edges.vectors(state.Lambda))
        value += energy.inextensibility * (strain**2).mean(axis=1)
    past = before if energy.tied else None
    chain = state if past is None else join([past.state, state])
    if len(chain) > 1:
        value[len(state) - len(chain) + 1 :] += smoothness(energy, chain[:-1], chain[1:], past.hold if past else None)
    return np.asarray(value)


def linearise(energy: Energy, data: Statistics, state: State, before: Past | None, value: Array | None = None) -> Normal:
    """Value (n,), if it is not known, gradient and Gauss-Newton blocks of the whole energy at a state."""
    n, r = len(state), state.Lambda.shape[2]
    value = evaluate(energy, data, state, before) if value is None else value
    rows = energy.rows if energy.bending is None else ALL_ROWS
    d = POSE + len(rows) * r
    normal = Normal(value, np.zeros((n, d)), np.zeros((n, d, d)), np.zeros((n - 1, d, d)))
    add_data(normal, rows, data, state)
    if energy.edges is not None:
        add_inextensibility(normal, rows, energy.inextensibility, energy.edges, state)
    if energy.bending is not None:
        normal = following(normal, energy.bending.slope(state.Lambda))
    add_rest(normal, energy, state)
    add_smoothness(normal, energy, state, before)
    if not energy.free_scale:
        normal.gradient[:, 5] = 0.0
        normal.diagonal[:, 5, :] = normal.diagonal[:, :, 5] = 0.0
        normal.diagonal[:, 5, 5] = 1.0
        normal.coupling[:, 5, :] = normal.coupling[:, :, 5] = 0.0
    return normal


def data_normal(data: Statistics, state: State) -> Normal:
    """The data term alone, all rows of Λ free."""
    n, d = len(state), POSE + state.Lambda[0].size
    normal = Normal(np.zeros(n), np.zeros((n, d)), np.zeros((n, d, d)), np.zeros((n - 1, d, d)))
    add_data(normal, ALL_ROWS, data, state)
    return normal


def add_data(normal: Normal, free_rows: tuple[int, ...], data: Statistics, state: State) -> None:
    """Reprojection, quadratic in M: pose by the chain rule, Λ as a Kronecker product of AᵀA and the Υ part of the sums."""
    n, r = len(state), state.Lambda.shape[2]
    rows = list(free_rows)
    M = state.matrices()
    A = M[:, :, :3]
    pose = np.zeros((n, POSE, 3, 4 + r))  # dM/d(θ, t, log s)
    X = np.concatenate([np.broadcast_to(np.eye(3), (n, 3, 3)), state.Lambda], axis=2)
    pose[:, :3, :, :-1] = A[:, None] @ (HAT @ X[:, None])
    pose[:, 3, 0, -1] = pose[:, 4, 1, -1] = 1.0
    pose[:, 5, :, :-1] = M[:, :, :-1]
    slope = statistics.gradient(data, M)
    curved = statistics.apply(data, pose)
    flat = pose.reshape(n, POSE, -1)
    normal.gradient[:, :POSE] += (flat @ slope.reshape(n, -1, 1))[:, :, 0]
    normal.diagonal[:, :POSE, :POSE] += flat @ curved.reshape(n, POSE, -1).transpose(0, 2, 1)
    if not rows or not r:
        return
    free = A[:, :, rows]
    k = len(rows) * r
    normal.gradient[:, POSE:] += (free.transpose(0, 2, 1) @ slope[:, :, 3:-1]).reshape(n, k)
    mixed = (free.transpose(0, 2, 1)[:, None] @ curved[:, :, :, 3:-1]).reshape(n, POSE, k)
    normal.diagonal[:, :POSE, POSE:] += mixed
    normal.diagonal[:, POSE:, :POSE] += mixed.transpose(0, 2, 1)
    both = free[:, :, None, :, None] * free[:, None, :, None, :]  # (n, 3, 3, rows, rows)
    twice = both + both.transpose(0, 2, 1, 3, 4)
    factors = np.stack([both[:, 0, 0] + both[:, 1, 1], -twice[:, 0, 2], -twice[:, 1, 2], both[:, 2, 2]], axis=1)
    modes = data.gram[:, :, 3:-1, 3:-1]
    kron = (factors.reshape(n, 4, -1).transpose(0, 2, 1) @ modes.reshape(n, 4, -1)).reshape(n, len(rows), len(rows), r, r)
    by_rows = normal.diagonal[:, POSE:, POSE:].reshape(n, len(rows), r, len(rows), r)  # a view
    by_rows += kron.transpose(0, 1, 3, 2, 4)


def following(normal: Normal, slope: Array) -> Normal:
    """The same by row τ alone, from which all rows follow with the given slope (n, 3r, r): the chain rule through them."""
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


def smoothness(energy: Energy, earlier: State, later: State, hold: Array | None = None) -> Array:
    """Change (n,) between frames and their successors: λ_q‖Δq‖² + λ_t‖Δt‖² + λ_s(Δ log s)² + that of Λ', see `change_of`.

    With `hold` the latter is ΔΛ'ᵀ H ΔΛ' for the first of them.
    """
    change, cost, _ = change_of(energy, earlier, later)
    if hold is not None:
        cost[0] = change[0] @ hold @ change[0]
    return np.asarray(
        energy.rotation * (quaternion_difference(earlier.q, later.q) ** 2).sum(axis=1)
        + energy.translation * ((later.t - earlier.t) ** 2).sum(axis=1)
        + energy.scale * (later.log_s - earlier.log_s) ** 2
        + cost
    )


def change_of(energy: Energy, earlier: State, later: State) -> tuple[Array, Array, Array]:
    """Change ΔΛ' (n, k) of the free rows between successive frames, its cost (n,), weights on its squares (n or 1, k).

    The cost is λ_γ‖ΔΛ'‖²; with jumps, of size j, it is j log(1 + λ_γ‖ΔΛ'‖²/j), as of a heavy-tailed distribution: what
    holds still is held, what moves is let go.
    """
    change = (later.Lambda - earlier.Lambda)[:, energy.rows, :]
    weights = energy.smoothness * np.ones(change.shape[1:])
    change, weights = change.reshape(len(change), weights.size), weights.reshape(1, weights.size)
    cost = (weights * change**2).sum(axis=1)
    if energy.jump < np.inf:
        weights = weights / (1 + cost / energy.jump)[:, None]
        cost = energy.jump * np.log1p(cost / energy.jump)
    return change, cost, weights


def quaternion_difference(earlier: Array, later: Array) -> Array:
    """Δq (n, 4) with the sign of `earlier` that is nearer: q and −q are the same rotation."""
    nearer = np.where((earlier * later).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    return np.asarray(later - nearer * earlier)


def quaternion_tangent(q: Array) -> Array:
    """dq/dθ (n, 4, 3) of q ⊗ exp(θ/2) at θ = 0."""
    return 0.5 * left_matrix(q)[..., 1:]


def add_smoothness(normal: Normal, energy: Energy, state: State, before: Past | None) -> None:
    """Differences of neighbours inside the window, and of the oldest frame to the one that has left it."""
    past = before if energy.tied else None
    chain = state if past is None else join([past.state, state])
    earlier, later = chain[:-1], chain[1:]
    n, d = len(later), normal.gradient.shape[1]
    if n == 0:
        return
    nearer = np.where((earlier.q * later.q).sum(axis=1) < 0, -1.0, 1.0)[:, None, None]
    tangents = quaternion_tangent(chain.q)
    J_earlier, J_later = -nearer * tangents[:-1], tangents[1:]
    delta = quaternion_difference(earlier.q, later.q)[:, :, None]
    change, weights = np.zeros((n, d)), np.zeros((n, d))
    change[:, 3:5], weights[:, 3:5] = later.t - earlier.t, energy.translation
    change[:, 5], weights[:, 5] = later.log_s - earlier.log_s, energy.scale
    change[:, POSE:], _, weights[:, POSE:] = change_of(energy, earlier, later)
    if past is not None and past.hold is not None:
        weights[0, POSE:] = 0.0
        normal.gradient[0, POSE:] += past.hold @ change[0, POSE:]
        normal.diagonal[0, POSE:, POSE:] += past.hold
    inner = slice(0 if past is None else 1, n)  # the others tie frames of the window to each other
    for J, sign, frames in ((J_later, 1.0, slice(n)), (J_earlier, -1.0, inner)):
        target = slice(len(state) - n, None) if sign > 0 else slice(len(state) - 1)
        Jt = energy.rotation * J[frames].transpose(0, 2, 1)
        normal.gradient[target, :3] += (Jt @ delta[frames])[:, :, 0]
        normal.gradient[target, 3:] += sign * weights[frames, 3:] * change[frames, 3:]
        normal.diagonal[target, :3, :3] += Jt @ J[frames]
        diagonals(normal.diagonal[target])[:, 3:] += weights[frames, 3:]
    normal.coupling[:, :3, :3] += energy.rotation * J_earlier[inner].transpose(0, 2, 1) @ J_later[inner]
    diagonals(normal.coupling)[:, 3:] -= weights[inner, 3:]


def diagonals(blocks: Array) -> Array:
    """The diagonals (n, d) of blocks (n, d, d), to be changed in place."""
    return np.asarray(np.einsum("nii->ni", blocks))
