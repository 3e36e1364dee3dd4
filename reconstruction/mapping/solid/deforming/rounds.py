"""Rounds of expectation and maximisation: poses and Λ' of keyframes by a Gaussian of Λ', and that by them.

Given the Gaussian, pose and Λ' of a frame are a Gauss-Newton step on the sums over its points (`window.statistics`), and
the covariance of Λ' is a block of the inverse of its normal matrix. Given those of all frames, the Gaussian has the second
moments that they have, and the rest shape, free in every point, is what suits all images best.
Every two rounds tell where they lead to (`acceleration`).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dpotri, dpotrs

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.constraints import ALL_ROWS
from reconstruction.basis.model import Model
from reconstruction.mapping.solid.building import TAIL_SIGMAS
from reconstruction.mapping.solid.bundle import Loss
from reconstruction.mapping.solid.deforming.acceleration import extrapolated
from reconstruction.mapping.solid.deforming.deformations import Deformations, Learned
from reconstruction.state import POSE, State
from reconstruction.window.normal import cholesky, from_lower, inverted
from reconstruction.window.robust import deviation, lengths
from reconstruction.window.statistics import Products, residuals
from reconstruction.window.terms import data_normal

BELIEVED = 2.0  # keyframes' worth of a Gaussian in which only the modes differ, by their eigenvalues
KEPT = 0.7  # of the points' weights: where rounds lead to, a fifth may be off for a while, and comes back
SCALE = 0.02  # deviation of log s from where it was at first: what comes nearer may as well swell
LEAST_NOISE = 7.5e-3  # of the size: neighbours' errors are alike, and what is believed of them goes into depth
NUMBERS = 2**16  # of Hessians at once: they stay in the cache
LOOSE = 1e-3  # pull of a point of the rest shape to where it was, of what images say about it


class Rounds:
    """Rounds that make keyframes likelier.

    Args:
        model: a solid with its modes.
        some: (n,) points of it that are looked at.
        seen: (K, 2, n) where, in units of the shape's size; finite.
        visible: (K, n).
        log_s: (K,) to which scales are held.
    """

    def __init__(self, model: Model, some: Indices, seen: Array, visible: Mask, log_s: Array) -> None:
        self._products = Products(model.B[:, some])
        self._some, self._seen, self._visible, self._focal, self._log_s = some, seen, visible, model.focal, log_s
        alike = np.tile(model.basis.eigenvalues**0.5, 3)
        self._believed = np.diag(alike / alike.sum())

    def begun(self, B: Array, state: State) -> Learned:
        """What keyframes tell by where they are, with the basis B (4 + r, p)."""
        off = residuals(B[:, self._some], self._seen, state.matrices(), self._focal)
        noise = deviation(lengths(off)[self._visible], LEAST_NOISE)
        return self._maximised(B, state, np.zeros_like(self._believed), noise, 0.0)

    def round(self, known: Learned) -> Learned:
        """Noise and rest shape by pose and Λ', these by the Gaussian, and that by them."""
        B, state, noise, every = known.B.copy(), known.state, known.deformations.noise, slice(None)
        off, squares, h = self._left_over(known, every)
        total = (h * squares).sum() + len(state) * known.taken * noise**2
        noise = max(float(np.sqrt(total / (2 * h.sum()))), LEAST_NOISE)
        B[:3, self._some] += shifts(self._seen, off, h, state, self._focal)
        known = replace(known, B=B, deformations=replace(known.deformations, noise=noise))
        precision = inverted(known.deformations.covariance)
        found = expected(self._normals(known, precision, h, every), state, precision)
        return self._maximised(B, found.state, found.unsure, noise, found.held)

    def further(self, before: Learned, once: Learned, twice: Learned) -> Learned:
        """Where two rounds lead to, unless that loses what images show."""
        there, every = extrapolated(before, once, twice), slice(None)
        kept = self._left_over(there, every)[2].sum() >= KEPT * self._left_over(twice, every)[2].sum()
        return there if kept else twice

    def by_others(self, known: Learned, frames: slice) -> Deformations:
        """The Gaussian that a round has found, without what some of its frames have given to it."""
        K, own = len(known.state) + BELIEVED, known.state.Lambda[frames].reshape(-1, len(self._believed))
        return replace(known.deformations, covariance=(K * known.deformations.covariance - own.T @ own) / (K - len(own)))

    def settled(self, known: Learned, frames: slice, steps: int) -> tuple[State, Array]:
        """Pose and Λ' of some frames, alone in `known`, after so many steps; minus their log likelihoods (n,)."""
        precision = inverted(known.deformations.covariance)
        for _ in range(steps):
            normals = self._normals(known, precision, self._left_over(known, frames)[2], frames)
            step = np.stack([-dpotrs(cholesky(H), g, lower=1)[0] for H, g in normals])
            known = replace(known, state=known.state.moved(step, ALL_ROWS))
        state, noise = known.state, known.deformations.noise
        Lambda = state.Lambda.reshape(len(state), -1)
        images = (self._visible[frames] * robust(noise).value(self._left_over(known, frames)[1])).sum(axis=1) / noise**2
        scales = ((state.log_s - self._log_s[frames]) / SCALE) ** 2
        return state, images + ((Lambda @ precision * Lambda).sum(axis=1) + scales) / 2

    def judged(self, known: Learned) -> Learned:
        """The same with how likely it is, and what images leave open."""
        every, precision = slice(None), inverted(known.deformations.covariance)
        h = self._left_over(known, every)[2]
        there = expected(self._normals(known, precision, h, every), known.state, precision)
        told = replace(known.deformations, left_open=left_open(known.B, there.unsure))
        return replace(known, deformations=told, unlikeliness=self._unlikeliness(known, there.log_volume))

    def _unlikeliness(self, known: Learned, log_volume: float) -> float:
        """Minus the log likelihood of the images, whatever Λ' is, over how many points they show (Laplace's way)."""
        covariance, noise = known.deformations.covariance, known.deformations.noise
        at_best = self.settled(known, slice(None), 0)[1].sum()
        volumes = log_volume + len(known.state) * np.linalg.slogdet(covariance)[1]
        return float((at_best + volumes / 2) / self._visible.sum() + 2 * np.log(noise))

    def _left_over(self, known: Learned, frames: slice) -> tuple[Array, Array, Array]:
        """Residuals (n, 2, p) of the frames that `known` has, their squared lengths (n, p), and robust weights (n, p)."""
        off = residuals(known.B[:, self._some], self._seen[frames], known.state.matrices(), self._focal)
        squares = (off**2).sum(axis=1)
        return off, squares, self._visible[frames] * robust(known.deformations.noise).weight(squares)

    def _normals(self, known: Learned, precision: Array, h: Array, frames: slice) -> Iterator[tuple[Array, Array]]:
        """Hessian (d, d) and gradient (d,) of half the energy of each of the frames that `known` has.

        Args:
            known: the Gaussian, and where frames are.
            precision: (3r, 3r) of Λ'.
            h: (n, p) weights.
            frames: which of all they are.
        """
        state, at_once = known.state, max(1, NUMBERS // (POSE + len(precision)) ** 2)
        self._products.change_rest(known.B[:, self._some])
        weights = h * (len(self._some) / known.deformations.noise**2)
        pulled = state.Lambda.reshape(len(state), -1) @ precision
        narrowed = (state.log_s - self._log_s[frames]) / SCALE**2
        for k, data in enumerate(self._products.statistics(self._seen[frames], weights, self._focal, at_once)):
            part = slice(k * at_once, (k + 1) * at_once)
            normal = data_normal(data, state[part])
            H, g = normal.diagonal, normal.gradient
            H[:, POSE:, POSE:] += precision
            g[:, POSE:] += pulled[part]
            H[:, POSE - 1, POSE - 1] += SCALE**-2
            g[:, POSE - 1] += narrowed[part]
            yield from zip(H, g, strict=True)

    def _maximised(self, B: Array, state: State, unsure: Array, noise: float, taken: float) -> Learned:
        """The Gaussian of frames whose Λ' has the mean covariance `unsure`, about the mean of their shapes."""
        K, mean = len(state), state.Lambda.mean(axis=0)
        B = np.concatenate([B[:3] + mean @ B[3:-1], B[3:]])
        state = replace(state, Lambda=state.Lambda - mean)
        Lambda = state.Lambda.reshape(K, -1)
        moments = Lambda.T @ Lambda / K + unsure
        covariance = (K * moments + BELIEVED * np.trace(moments) * self._believed) / (K + BELIEVED)
        return Learned(B, state, Deformations(covariance, noise), taken)


def robust(noise: float) -> Loss:
    """The loss of residuals with that deviation."""
    return Loss(TAIL_SIGMAS * noise, redescending=True)


@dataclass(frozen=True)
class Expected:
    """What is to be expected of n frames.

    Attributes:
        state: pose and Λ' after a step.
        unsure: (3r, 3r) mean covariance of Λ'.
        held: mean number of parameters that the images hold.
        log_volume: sum of the logarithms of the Hessians' determinants.
    """

    state: State
    unsure: Array
    held: float
    log_volume: float


def expected(normals: Iterable[tuple[Array, Array]], state: State, precision: Array) -> Expected:
    """By Hessian (d, d) and gradient (d,) of each frame, where they are, and the precision (3r, 3r) of Λ'."""
    d = POSE + len(precision)
    total, steps, log_volume = np.zeros((d, d), order="F"), list[Array](), 0.0
    for H, g in normals:
        factor = cholesky(H)
        steps.append(-dpotrs(factor, g, lower=1)[0])
        log_volume += 2 * np.log(factor.diagonal()).sum()
        total += dpotri(factor, lower=1, overwrite_c=1)[0]
    inverse = from_lower(total) / len(state)
    known = (inverse[POSE:, POSE:] * precision).sum() + inverse[POSE - 1, POSE - 1] / SCALE**2  # beforehand
    return Expected(state.moved(np.stack(steps), ALL_ROWS), inverse[POSE:, POSE:], d - float(known), log_volume)


def left_open(B: Array, unsure: Array) -> float:
    """Standard deviation of a point of a keyframe's shape, RMS, over the rest shape's size.

    Args:
        B: (4 + r, p) the basis.
        unsure: (3r, 3r) mean covariance of Λ'.
    """
    modes = B[3:-1]
    r = len(modes)
    of_modes = np.trace(unsure.reshape(3, r, 3, r), axis1=0, axis2=2)
    return float(np.sqrt(((of_modes @ modes) * modes).sum(axis=0).mean() / B[:3].var(axis=1).sum()))


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
