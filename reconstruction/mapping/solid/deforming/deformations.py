"""Which deformations a solid shows, learned from its keyframes: a Gaussian of Λ', by expectation maximisation.

An image says nothing about depth. But a face opens its mouth again and again, seen from here and from there: which
coefficients go together, and how far, tells of every frame what its image leaves open. Torresani, Hertzmann and Bregler
(PAMI 2008) found this for points that are free to move; here it is done in the space of the paper's modes, and in
perspective.

Given the Gaussian, pose and Λ' of a frame are a Gauss-Newton step on the sums over its points (`window.statistics`), and
the covariance of Λ' is a block of the inverse of its normal matrix. Given those of all frames, the Gaussian has the second
moments that they have, and the rest shape, free in every point, is what suits all images best.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotri

from reconstruction.arrays import Array, Mask
from reconstruction.basis.constraints import ALL_ROWS
from reconstruction.basis.model import Model
from reconstruction.mapping.solid.building import TAIL_SIGMAS
from reconstruction.mapping.solid.bundle import Loss
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.mapping.solid.spikes import without_new_spikes
from reconstruction.state import POSE, State
from reconstruction.window.energy import Pull
from reconstruction.window.robust import deviation, lengths
from reconstruction.window.statistics import Statistics, frame_statistics, residuals, stack
from reconstruction.window.terms import data_normal

ROUNDS = 40  # depth comes to light slowly, and in ever more rounds what is noise does, too
POINTS = 400  # by which it is learned: dense ones are placed afterwards
BELIEVED = 2.0  # keyframes' worth of a Gaussian in which only the modes differ, by their eigenvalues
SCALE = 0.02  # deviation of log s from where it was at first: what comes nearer may as well swell
LEAST_NOISE = 5e-3  # of the size: neighbours' errors are alike, and what is believed of them goes into depth
LOOSE = 1e-3  # pull of a point of the rest shape to where it was, of what images say about it


@dataclass(frozen=True)
class Deformations:
    """A Gaussian of Λ' about the rest shape.

    Attributes:
        covariance: (3r, 3r) of Λ', row after row.
        noise: standard deviation of a coordinate of an image point, over the shape's size.
    """

    covariance: Array
    noise: float

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
        state: pose and Λ' of the keyframes (n = K).
        deformations: the Gaussian.
    """

    B: Array
    state: State
    deformations: Deformations


def learned(model: Model, W: Array, visible: Mask, state: State, rounds: int = ROUNDS) -> Learned:
    """The Gaussian, and the rest shape about which it is, from where a window has found the keyframes to be.

    Args:
        model: a solid with its modes.
        W: (K, 2, p) px; finite.
        visible: (K, p).
        state: pose and Λ' of each (n = K).
        rounds: of expectation and maximisation.
    """
    K, B, focal = len(state), model.B.copy(), model.focal
    some = well_spread(B[:3], visible, POINTS)
    seen, log_s = model.normalised(W), state.log_s
    off = residuals(B[:, some], seen[:, :, some], state.matrices(), focal)
    noise = deviation(lengths(off)[visible[:, some]], LEAST_NOISE)
    alike = np.tile(model.basis.eigenvalues**0.5, 3)
    believed = np.diag(alike / alike.sum())
    unsure, taken = np.zeros_like(believed), 0.0  # covariance of Λ', and parameters that the images hold; both of a frame
    for _ in range(rounds):
        state, B = about_mean(state, B)
        off = residuals(B[:, some], seen[:, :, some], state.matrices(), focal)
        squares = (off**2).sum(axis=1)
        h = visible[:, some] * robust(noise).weight(squares)
        total = (h * squares).sum() + K * taken * noise**2
        noise = max(float(np.sqrt(total / (2 * h.sum()))), LEAST_NOISE)
        B[:3, some] += shifts(seen[:, :, some], off, h, state, focal)
        Lambda = state.Lambda.reshape(K, -1)
        moments = Lambda.T @ Lambda / K + unsure
        covariance = (K * moments + BELIEVED * np.trace(moments) * believed) / (K + BELIEVED)
        frames = zip(seen[:, :, some], h, strict=True)
        data = stack([frame_statistics(B[:, some], one, weight, focal) for one, weight in frames])
        state, unsure, taken = expected(data, state, inverted(covariance), noise**2 / len(some), log_s)
    state, B = about_mean(state, B)
    if len(some) < B.shape[1]:
        off = residuals(B, seen, state.matrices(), focal)
        h = visible * robust(noise).weight((off**2).sum(axis=1))
        B[:3] += shifts(seen, off, h, state, focal)
    B[:3] = without_new_spikes(B[:3], model.B[:3], visible)
    return Learned(B, state, Deformations(covariance, noise))


def robust(noise: float) -> Loss:
    """The loss of residuals with that deviation."""
    return Loss(TAIL_SIGMAS * noise, redescending=True)


def about_mean(state: State, B: Array) -> tuple[State, Array]:
    """The same frames, the rest shape S̄' of the basis B (4 + r, p) moved to the mean of their shapes."""
    mean = state.Lambda.mean(axis=0)
    moved = np.concatenate([B[:3] + mean @ B[3:-1], B[3:]])
    return replace(state, Lambda=state.Lambda - mean), moved


def expected(data: Statistics, state: State, precision: Array, variance: float, log_s: Array) -> tuple[State, Array, float]:
    """Pose and Λ' after a step; mean covariance (3r, 3r) of Λ', and mean number of parameters that the images hold.

    Args:
        data: of n frames.
        state: where these are.
        precision: (3r, 3r) of Λ'.
        variance: of the mean of a coordinate over the points.
        log_s: (n,) to which it is held.
    """
    n, r3 = len(state), len(precision)
    normal = data_normal(data, state)
    H, g = normal.diagonal / variance, normal.gradient / variance
    H[:, POSE:, POSE:] += precision
    g[:, POSE:] += state.Lambda.reshape(n, r3) @ precision
    H[:, POSE - 1, POSE - 1] += SCALE**-2
    g[:, POSE - 1] += (state.log_s - log_s) / SCALE**2
    covariance, step, taken = np.zeros((r3, r3)), np.zeros_like(g), 0.0
    for k in range(n):
        inverse = inverted(H[k])
        step[k] = -inverse @ g[k]
        covariance += inverse[POSE:, POSE:] / n
        taken += float((inverse * normal.diagonal[k]).sum()) / variance / n
    return state.moved(step, ALL_ROWS), covariance, taken


def inverted(matrix: Array) -> Array:
    """The inverse of a symmetric positive definite matrix.

    Raises:
        LinAlgError: it is not.
    """
    factor, failed = dpotrf(matrix, lower=1)
    if failed:
        raise np.linalg.LinAlgError("not positive definite")
    inverse = np.tril(dpotri(factor, lower=1)[0])
    return np.asarray(inverse + np.tril(inverse, -1).T)


def shifts(seen: Array, off: Array, h: Array, state: State, focal: float) -> Array:
    """Of the rest shape's points (3, p), poses and deformations known, by linear least squares.

    Args:
        seen: (K, 2, p) in units of the shape's size,
        off: (K, 2, p) its residuals,
        h: (K, p) and their weights.
        state: pose and Λ' (n = K).
        focal: in the same units.
    """
    A = state.scaled_rotations()
    rows = A[:, :2, :, None] - seen[:, :, None] / focal * A[:, 2:, :, None]  # (K, 2, 3, p)
    normal = np.einsum("kp,kuap,kubp->pab", h, rows, rows, optimize=True)
    right = np.einsum("kp,kuap,kup->pa", h, rows, off, optimize=True)
    loose = (LOOSE * np.trace(normal, axis1=1, axis2=2) + np.finfo(float).tiny ** 0.5)[:, None, None] * np.eye(3)
    return np.asarray(np.linalg.solve(normal + loose, right[:, :, None])[:, :, 0].T)
