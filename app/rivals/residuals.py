"""The window's energy as a sum of squared residuals with analytic derivatives, point by point: what its rivals are given.

A frame's parameters are q (4, w first), t (2), log s and the free rows of Λ' (row by row).
"""

import numpy as np

from app.arrays import Array
from app.rivals.problems import WindowStep
from reconstruction.camera import SANDWICH, rotation_from_quaternion
from reconstruction.state import State

TURN = SANDWICH.reshape(4, 4, 3, 3)
TURN = TURN + TURN.swapaxes(0, 1)  # dR/dq_i = Σ_j TURN[ij] q_j


class FrameData:
    """Reprojection of one frame: ρ/√p, all x first.

    Args:
        step: the problem.
        W: (2, p) the frame's points.
    """

    def __init__(self, step: WindowStep, W: Array) -> None:
        self.step, self.W = step, W
        self._slope = (W / step.focal)[:, None]  # w
        self._modes = np.ascontiguousarray(step.B[3:-1].T)

    def residual(self, q: Array, t: Array, log_s: float, free: Array) -> Array:
        """(2p,)."""
        seen = self._placed(np.exp(log_s) * rotation_from_quaternion(q), self._shape(free))
        return np.asarray((self.W - t[:, None] - seen).ravel() / np.sqrt(self.step.points))

    def derivatives(self, q: Array, log_s: float, free: Array, *, out: tuple[Array, Array, Array, Array]) -> None:
        """Write the derivatives with respect to q (2p, 4), t (2p, 2), log s (2p, 1) and the free rows of Λ' (2p, k)."""
        p, by = self.step.points, -1 / np.sqrt(self.step.points)
        of_q, of_t, of_log_s, of_Lambda = out
        A, shape = np.exp(log_s) * rotation_from_quaternion(q), self._shape(free)
        for i, turned in enumerate(np.exp(log_s) * np.tensordot(q, TURN, 1)):
            of_q[:, i] = by * self._placed(turned, shape).ravel()
        of_t[:p], of_t[p:] = (by, 0), (0, by)
        of_log_s[:, 0] = by * self._placed(A, shape).ravel()
        rows = list(self.step.energy.rows)
        lever = by * (A[:2, None, :] - self._slope.transpose(0, 2, 1) * A[2])[:, :, rows]  # (2, p, rows)
        np.multiply(lever[..., None], self._modes[:, None, :], out=of_Lambda.reshape(2, p, len(rows), -1))

    def _shape(self, free: Array) -> Array:
        """(3, p) in the principal frame."""
        shape = self.step.B[:3].copy()
        shape[list(self.step.energy.rows)] += free.reshape(-1, self.step.modes) @ self.step.B[3:-1]
        return shape

    def _placed(self, A: Array, shape: Array) -> Array:
        """A S (2, p) multiplied out for perspective: (A S)_c − w_c (A S)_3."""
        moved = A @ shape
        return np.asarray(moved[:2] - self._slope[:, 0] * moved[2])


def change_weights(step: WindowStep) -> Array:
    """Roots of the weights on a frame's change (7 + k,): of q, t, log s and the free rows of Λ'."""
    energy, shape = step.energy, (len(step.energy.rows), step.modes)
    pose = [energy.rotation] * 4 + [0.0] * 2 + [energy.scale]
    return np.asarray(np.sqrt(np.concatenate([pose, np.broadcast_to(energy.smoothness, shape).ravel()])))


def rest_weights(step: WindowStep) -> Array:
    """Roots of the weights (k,) on the free rows of Λ' themselves."""
    shape = (len(step.energy.rows), step.modes)
    return np.asarray(np.sqrt(np.broadcast_to(step.energy.rest, shape)).ravel())


def parameters(state: State, rows: tuple[int, ...]) -> Array:
    """(n, 7 + k) of the frames of a state, signs of q made to agree."""
    q = state.q.copy()
    for i in range(1, len(q)):
        q[i] *= -1.0 if q[i] @ q[i - 1] < 0 else 1.0
    free = state.Lambda[:, rows, :].reshape(len(state), -1)
    return np.concatenate([q, state.t, state.log_s[:, None], free], axis=1)
