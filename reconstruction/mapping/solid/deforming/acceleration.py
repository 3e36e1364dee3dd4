"""Where the rounds of expectation maximisation lead to, by two of them (SQUAREM; Varadhan and Roland, 2008).

Rounds that make ever smaller steps r, s in the same direction would end 1/(1 − |s|/|r|) of them away. That is so for what
images say little about, depth, and not for what they show; one length of step suits all, as long as rounds in between put
right what it has spoilt.
"""

import numpy as np
from scipy.linalg import solve_triangular

from reconstruction.arrays import Array
from reconstruction.basis.constraints import ALL_ROWS
from reconstruction.camera import CONJUGATE, quaternion_product
from reconstruction.mapping.solid.deforming.deformations import Deformations, Learned
from reconstruction.state import State

LONGEST = 8.0  # times a round's step, at most
CHANGED = 0.3, 4.0  # times what a variance was, at least and at most


def extrapolated(before: Learned, once: Learned, twice: Learned) -> Learned:
    """Where a round that led from `before` to `once` and to `twice` leads to."""
    Sigma = [known.deformations.covariance for known in (before, once, twice)]
    first, change = Sigma[1] - Sigma[0], Sigma[2] - 2 * Sigma[1] + Sigma[0]
    length = np.clip(np.linalg.norm(first) / np.maximum(np.linalg.norm(change), 1e-300), 1.0, LONGEST)

    def beyond(r: Array, s: Array) -> Array:
        return np.asarray((length - 1) * ((length + 1) * s - (length - 1) * r))

    B = twice.B.copy()
    B[:3] += beyond(once.B[:3] - before.B[:3], twice.B[:3] - once.B[:3])
    steps = step(before.state, once.state), step(once.state, twice.state)
    covariance = not_far_from(Sigma[2], beyond(first, Sigma[2] - Sigma[1]))
    return Learned(
        B,
        twice.state.moved(beyond(*steps), ALL_ROWS),
        Deformations(covariance, twice.deformations.noise),
        twice.taken,
    )


def step(state: State, to: State) -> Array:
    """The step (n, d) from one state to another, which is near."""
    turned = quaternion_product(state.q * CONJUGATE, to.q)
    sine = np.linalg.norm(turned[:, 1:], axis=1, keepdims=True)
    theta = 2 * np.arctan(sine / turned[:, :1]) / np.maximum(sine, 1e-300) * turned[:, 1:]
    moved = to.t - state.t, (to.log_s - state.log_s)[:, None], (to.Lambda - state.Lambda).reshape(len(to), -1)
    return np.concatenate([theta, *moved], axis=1)


def not_far_from(covariance: Array, change: Array) -> Array:
    """A covariance and a change of it, no variance of which is another by more than `CHANGED`."""
    L = np.linalg.cholesky(covariance)
    whitened = solve_triangular(L, solve_triangular(L, change, lower=True).T, lower=True)
    times, axes = np.linalg.eigh(np.eye(len(L)) + (whitened + whitened.T) / 2)
    half = L @ axes * np.sqrt(np.clip(times, *CHANGED))
    return half @ half.T
