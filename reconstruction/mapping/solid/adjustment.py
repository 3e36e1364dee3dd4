"""Rigid bundle adjustment: all poses, all points and the focal length at once, by Levenberg-Marquardt.

Points are eliminated (Schur complement): a step is one matrix product over the points and one small dense system.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconstruction.arrays import Array
from reconstruction.camera import NEAREST
from reconstruction.mapping.solid.bundle import POSE, Bundle, Derivatives, Loss, Prior, beyond_all, off_plane
from reconstruction.mapping.solid.factors import Factors

SMALLEST = 1e-2  # scale of a view over that of another: a loss that leaves the parabola may shrink one that does not fit
GIVING_UP = 1e6  # damping at which no step helps any more
FIXED = [0, 1, 2, 5]  # of the first view: its turn and scale are the shape's axes and unit


@dataclass(frozen=True)
class Adjustment:
    """What a call of `adjust` may change.

    Attributes:
        steps: most iterations.
        tolerance: relative gain below which it stops.
        points, poses: whether the shape is free; and the poses, and with both the focal length.
    """

    steps: int = 30
    tolerance: float = 1e-4
    points: bool = True
    poses: bool = True


def adjust(W: Array, h: Array, bundle: Bundle, loss: Loss, prior: Prior, how: Adjustment) -> tuple[Bundle, float]:
    """Minimise Σ h ρ(‖u − W‖) + prior.

    Args:
        W: (K, 2, p) relative to the principal point; anything finite where not visible.
        h: (K, p) weights.
        bundle: where to start.
        loss: ρ.
        prior: of depth and focal length.
        how: what may change, and how often.

    Returns:
        the bundle, and what the minimised sum is.
    """
    damping, value = 1e-3, energy(W, h, bundle, loss, prior)
    for _ in range(how.steps):
        system = System(W, h, bundle, loss, prior)
        while damping < GIVING_UP:
            with np.errstate(over="ignore", invalid="ignore"):  # of steps too far, which are not taken
                tried = bundle.moved(*system.step_of(how, damping))
                after = energy(W, h, tried, loss, prior)
            if after < value:
                break
            damping *= 5
        else:
            break
        gain, bundle, value, damping = 1 - after / value, tried, after, max(damping / 5, 1e-9)
        if gain < how.tolerance:
            break
    return bundle, value


def energy(W: Array, h: Array, bundle: Bundle, loss: Loss, prior: Prior) -> float:
    """What `adjust` minimises; infinite with a point seen too close to the camera, or a view that shrinks to one."""
    Y, s = bundle.placed(), bundle.motion.s
    if (
        not np.isfinite(Y).all()
        or s.min() < SMALLEST * s.max()
        or bundle.kappa * np.where(h > 0, Y[:, 2], 0.0).min() < NEAREST - 1
    ):
        return float("inf")
    return float((h * loss.value(((bundle.image(Y) - W) ** 2).sum(axis=1))).sum()) + prior.value(bundle)


@dataclass(frozen=True)
class System:
    """Gauss-Newton's normal equations of `energy`, the loss by its weights, the prior's plane held: views against points.

    What a step does not need is not worked out. Its attributes are the arguments of `adjust`.
    """

    W: Array
    h: Array
    bundle: Bundle
    loss: Loss
    prior: Prior

    def step_of(self, how: Adjustment, damping: float) -> tuple[Array, float, Array]:
        """Poses (K, 6), log κ, points (3, p), of what may change."""
        if not how.points:
            return self.pose_step(damping)
        return self.step(damping) if how.poses else self.point_step(damping)

    def step(self, damping: float) -> tuple[Array, float, Array]:
        """All at once."""
        factors = Factors.of(damped(self.points, damping))
        between = factors.whitened(self.between).reshape(len(self.right_views), -1)
        right = factors.whitened(self.right_points)
        schur = damped(self.views, damping) - between @ between.T
        d = np.linalg.solve(schur, self.right_views - between @ right.ravel())
        points = factors.back(right - (between.T @ d).reshape(right.shape))
        return np.asarray(d[:-1].reshape(-1, POSE)), float(d[-1]), points

    def pose_step(self, damping: float) -> tuple[Array, float, Array]:
        """With shape and focal length held."""
        d = np.linalg.solve(damped(self.views[:-1, :-1], damping), self.right_views[:-1])
        return np.asarray(d.reshape(-1, POSE)), 0.0, np.zeros_like(self.bundle.motion.shape)

    def point_step(self, damping: float) -> tuple[Array, float, Array]:
        """With poses and focal length held."""
        factors = Factors.of(damped(self.points, damping))
        return np.zeros((len(self.W), POSE)), 0.0, factors.back(factors.whitened(self.right_points))

    @cached_property
    def views(self) -> Array:
        """(6K + 1, 6K + 1) of poses and log κ."""
        n = POSE * len(self.W)
        views = np.zeros((n + 1, n + 1))
        k = np.arange(len(self.W))
        weighted, A = self._weighted_pose.reshape(len(k), POSE, -1), self._pose.reshape(len(k), POSE, -1)
        views[:n, :n].reshape(len(k), POSE, len(k), POSE)[k, :, k] = weighted @ A.transpose(0, 2, 1)
        views[FIXED, FIXED] = views[-1, -1] = 1.0
        if not self._held:
            b, longer = self.derivatives.by_log_kappa, self.plane[2]
            views[-1, :-1] = views[:-1, -1] = (weighted @ b.reshape(len(k), -1, 1)).ravel()
            views[-1, -1] = (
                (self.weights * (b * b).sum(axis=1)).sum() + self.prior.focal + self.prior.depth * longer @ longer
            )
        return views

    @cached_property
    def between(self) -> Array:
        """(6K + 1, 3, p)."""
        (K, _, p), B = self.W.shape, self.derivatives.by_point
        between = np.zeros((POSE * K + 1, 3, p))
        blocks, A = between[:-1].reshape(K, POSE, 3, p), self._weighted_pose
        np.multiply(A[:, :, None, 0], B[:, None, :, 0], out=blocks)
        blocks += A[:, :, None, 1] * B[:, None, :, 1]
        if not self._held:
            _, slope, longer = self.plane
            b = self.weights[:, None] * self.derivatives.by_log_kappa
            between[-1] = np.einsum("kcp,kdcp->dp", b, B) + self.prior.depth * longer * slope
        return between

    @cached_property
    def points(self) -> Array:
        """(3, 3, p)."""
        B, slope, outward = self.derivatives.by_point, self.plane[1], self.beyond[1]
        points = np.einsum("kdcp,kecp->dep", self.weights[:, None, None] * B, B)
        points += self.prior.depth * slope[:, None] * slope
        return np.asarray(points + self.prior.apart * outward[:, None] * outward)

    @cached_property
    def right_views(self) -> Array:
        """(6K + 1,) minus the gradient."""
        right = np.zeros(POSE * len(self.W) + 1)
        right[:-1] = -(self._pose * self._weighted[:, None]).sum(axis=(2, 3)).ravel()
        if not self._held:
            off, _, longer = self.plane
            right[-1] = -(self.derivatives.by_log_kappa * self._weighted).sum() - self.prior.depth * longer @ off
            right[-1] -= self.prior.focal * np.log(self.bundle.kappa / self.prior.kappa)
        return right

    @cached_property
    def right_points(self) -> Array:
        """(3, p) minus the gradient."""
        (off, slope, _), (beyond, outward) = self.plane, self.beyond
        by_prior = self.prior.depth * off * slope + self.prior.apart * beyond * outward
        return -np.einsum("kdcp,kcp->dp", self.derivatives.by_point, self._weighted) - by_prior

    @cached_property
    def derivatives(self) -> Derivatives:
        """Of the images."""
        return Derivatives(self.bundle)

    @cached_property
    def plane(self) -> tuple[Array, Array, Array]:
        """What `off_plane` finds."""
        return off_plane(self.bundle.motion.shape, self.bundle.kappa)

    @cached_property
    def beyond(self) -> tuple[Array, Array]:
        """What `beyond_all` finds."""
        return beyond_all(self.bundle.motion.shape, self.bundle.kappa)

    @cached_property
    def off(self) -> Array:
        """Residuals u − W (K, 2, p)."""
        return np.asarray(self.derivatives.image - self.W)

    @cached_property
    def weights(self) -> Array:
        """(K, p) of the residuals."""
        return np.asarray(self.h * self.loss.weight((self.off**2).sum(axis=1)))

    @cached_property
    def _weighted(self) -> Array:
        return np.asarray(self.weights[:, None] * self.off)

    @cached_property
    def _pose(self) -> Array:
        A = self.derivatives.by_pose  # asked for here only
        A[0, FIXED] = 0.0
        return A

    @cached_property
    def _weighted_pose(self) -> Array:
        return np.asarray(self._pose * self.weights[:, None, None])

    @property
    def _held(self) -> bool:
        return bool(np.isinf(self.prior.focal)) or self.bundle.kappa == 0


def damped(matrix: Array, damping: float) -> Array:
    """A matrix (n, n, ...), or many, with the diagonal enlarged."""
    k = np.arange(len(matrix))
    diagonal = matrix[k, k]
    matrix = matrix.copy()
    matrix[k, k] = (1 + damping) * diagonal + 1e-12 * diagonal.max(initial=1e-300)
    return matrix
