"""What is estimated: pose and coefficients of the frames of a window (paper §5).

A window of n frames holds q, t, log s and Λ' = Λ/√p per frame. A frame's d = 6 + (free rows of Λ)·r parameters are ordered
[θ (3, rotation vector applied on the right), t (2), log s, free rows of Λ' (row by row)].
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconstruction.arrays import Array
from reconstruction.camera import CONJUGATE, quaternion_exp, quaternion_product, rotation_from_quaternion

POSE = 6  # θ, t, log s


@dataclass(frozen=True)
class State:
    """Pose and coefficients of n frames in the principal frame, lengths in units of the rest shape's RMS radius.

    Attributes:
        q: (n, 4) unit quaternions of R' = RΦ, w first.
        t: (n, 2) image translation.
        log_s: (n,) logarithm of the scale.
        Lambda: (n, 3, r) Λ' = Λ/√p.
    """

    q: Array
    t: Array
    log_s: Array
    Lambda: Array

    def __len__(self) -> int:
        return len(self.log_s)

    def __getitem__(self, frames: slice) -> "State":
        return State(self.q[frames], self.t[frames], self.log_s[frames], self.Lambda[frames])

    def moved(self, step: Array, rows: tuple[int, ...]) -> "State":
        """The state after a step (n, d) in the local parameters, with the given rows of Λ free."""
        Lambda = self.Lambda.copy()
        Lambda[:, rows, :] += step[:, POSE:].reshape(len(self), len(rows), Lambda.shape[2])
        q = quaternion_product(self.q, quaternion_exp(step[:, :3]))
        q /= np.sqrt((q * q).sum(axis=1, keepdims=True))
        return State(q, self.t + step[:, 3:5], self.log_s + step[:, 5], Lambda)

    def scaled_rotations(self) -> Array:
        """A = sR' (n, 3, 3)."""
        return np.exp(self.log_s)[:, None, None] * rotation_from_quaternion(self.q)

    def matrices(self) -> Array:
        """M = [sR', sR'Λ', (t; 0)] (n, 3, 4 + r); not to be changed."""
        return self._matrices

    @cached_property
    def _matrices(self) -> Array:
        """The same: a step's energy and its derivatives both ask for it."""
        A = self.scaled_rotations()
        M = np.zeros((len(self), 3, 4 + self.Lambda.shape[2]))
        M[:, :, :3], M[:, :, 3:-1], M[:, :2, -1] = A, A @ self.Lambda, self.t
        return M


def join(states: list[State]) -> State:
    """One state of all frames, in order."""
    return State(
        np.concatenate([one.q for one in states]),
        np.concatenate([one.t for one in states]),
        np.concatenate([one.log_s for one in states]),
        np.concatenate([one.Lambda for one in states]),
    )


def extrapolated(earlier: State, last: State) -> State:
    """One frame further at constant velocity."""
    turned = quaternion_product(last.q, quaternion_product(earlier.q * CONJUGATE, last.q))
    return State(turned, 2 * last.t - earlier.t, 2 * last.log_s - earlier.log_s, 2 * last.Lambda - earlier.Lambda)


def with_newest(frames: State, newest: State) -> State:
    """The frames with another newest one (n = 1)."""
    return join([frames[:-1], newest])
