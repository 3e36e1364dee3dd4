"""What is known of a solid's deformations: a Gaussian of Λ' about its rest shape."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array
from reconstruction.camera import rotation_from_quaternion
from reconstruction.state import State
from reconstruction.window.energy import Pull
from reconstruction.window.normal import inverted

RIDGE = 1e-3  # of a rotation's entries squared, against turns about one axis, which leave some of them alike


@dataclass(frozen=True)
class Deformations:
    """A Gaussian of Λ' about the rest shape.

    Attributes:
        covariance: (3r, 3r) of Λ', row after row.
        noise: standard deviation of a coordinate of an image point, over the shape's size.
        turning: share of the keyframes' Λ' that goes with their turn, so that which is which is a guess.
        otherwise: how far off shapes are, as a share of their size, that make the keyframes about as likely.
        left_open: what images leave open: standard deviation of a point of a keyframe's shape, RMS, over its size.
    """

    covariance: Array
    noise: float
    turning: float = 0.0
    otherwise: float = 0.0
    left_open: float = 0.0

    def pull(self, points: int) -> Pull:
        """What it adds to the energy of a frame of so many points."""
        variance = self.noise**2 / points
        return Pull(variance * inverted(self.covariance), variance)

    def mirrored(self) -> "Deformations":
        """The same of the mirror image, whose row τ has the other sign."""
        sign = np.repeat([1.0, 1.0, -1.0], len(self.covariance) // 3)
        return replace(self, covariance=sign[:, None] * self.covariance * sign)


@dataclass(frozen=True)
class Learned:
    """What keyframes tell of a solid that deforms.

    Attributes:
        B: (4 + r, p) the model's basis, its rest shape S̄' another one.
        state: pose and Λ' of the keyframes (n = K), their mean 0.
        deformations: the Gaussian.
        taken: how many parameters the image of a keyframe holds, on average.
        unlikeliness: minus the log likelihood of an image point, in units of the model's size.
    """

    B: Array
    state: State
    deformations: Deformations
    taken: float = 0.0
    unlikeliness: float = np.inf

    @property
    def shapes(self) -> Array:
        """(K, 3, p) of the keyframes, in no camera's axes."""
        return np.asarray(self.B[:3] + self.state.Lambda @ self.B[3:-1])


def going_with_turn(state: State) -> float:
    """Share of the variance of Λ' that a frame's rotation foretells, linearly, by all other frames; 0 if it misleads.

    Things that turn once while they swell once would look alike if they were deeper and swelled less.
    """
    K = len(state)
    turn = rotation_from_quaternion(state.q)[:, :2].reshape(K, -1)
    known, told = (values - values.mean(axis=0) for values in (turn, state.Lambda.reshape(K, -1)))
    hat = known @ np.linalg.solve(known.T @ known + RIDGE * K * np.eye(known.shape[1]), known.T)
    left = (told - hat @ told) / (1 - 1 / K - np.diag(hat))[:, None]
    return float(max(0.0, 1 - (left**2).sum() / max((told**2).sum(), np.finfo(float).tiny)))
