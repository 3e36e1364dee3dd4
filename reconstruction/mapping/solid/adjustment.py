"""Rigid bundle adjustment: all poses, all points and the focal length at once, by Levenberg-Marquardt.

Points are eliminated (Schur complement): a step is one matrix product over the points and one small dense system.
"""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array
from reconstruction.mapping.solid.bundle import POSE, Bundle, Loss, Prior, derivatives, off_plane

NEAREST = 0.1  # a point's depth over its view's, closer than which no point may come to the camera
GIVING_UP = 1e6  # damping at which no step helps any more
FIXED = (0, 1, 2, 5)  # of the first view: its turn and scale are the shape's axes and unit


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
        system = linearise(W, h, bundle, loss, prior)
        while damping < GIVING_UP:
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
    """What `adjust` minimises; infinite with a point too close to the camera, or a step beyond all numbers."""
    Y = bundle.placed()
    if not np.isfinite(Y).all() or bundle.kappa * Y[:, 2].min() < NEAREST - 1:
        return float("inf")
    return float((h * loss.value(((bundle.image(Y) - W) ** 2).sum(axis=1))).sum()) + prior.value(bundle)


@dataclass(frozen=True)
class System:
    """Normal equations, arrow-shaped: views and focal length against points.

    Attributes:
        views: (6K + 1, 6K + 1) of poses and log κ.
        between: (p, 6K + 1, 3).
        points: (p, 3, 3).
        right_views, right_points: (6K + 1,), (p, 3): minus the gradient.
    """

    views: Array
    between: Array
    points: Array
    right_views: Array
    right_points: Array

    def step_of(self, how: Adjustment, damping: float) -> tuple[Array, float, Array]:
        """Poses (K, 6), log κ, points (3, p), of what may change."""
        if not how.points:
            return self.pose_step(damping)
        return self.step(damping) if how.poses else self.point_step(damping)

    def step(self, damping: float) -> tuple[Array, float, Array]:
        """All at once."""
        points = damped(self.points, damping)
        inverse = np.linalg.inv(points)
        carried = self.between @ inverse  # (p, n, 3)
        n = len(self.right_views)
        flat = [x.transpose(1, 0, 2).reshape(n, -1) for x in (carried, self.between)]
        schur = damped(self.views, damping) - flat[0] @ flat[1].T
        d = np.linalg.solve(schur, self.right_views - flat[0] @ self.right_points.ravel())
        back = self.right_points - (flat[1].T @ d).reshape(-1, 3)
        return np.asarray(d[:-1].reshape(-1, POSE)), float(d[-1]), np.asarray((inverse @ back[:, :, None])[:, :, 0].T)

    def pose_step(self, damping: float) -> tuple[Array, float, Array]:
        """With shape and focal length held."""
        n = len(self.right_views) - 1
        d = np.linalg.solve(damped(self.views[:n, :n], damping), self.right_views[:n])
        return np.asarray(d.reshape(-1, POSE)), 0.0, np.zeros((3, len(self.right_points)))

    def point_step(self, damping: float) -> tuple[Array, float, Array]:
        """With poses and focal length held."""
        d = np.linalg.solve(damped(self.points, damping), self.right_points[:, :, None])
        return np.zeros((len(self.right_views) // POSE, POSE)), 0.0, np.asarray(d[:, :, 0].T)


def damped(matrix: Array, damping: float) -> Array:
    """Matrices (..., n, n) with their diagonal enlarged."""
    diagonal = np.diagonal(matrix, axis1=-2, axis2=-1)
    least = 1e-12 * diagonal.max(initial=1e-300)
    return np.asarray(matrix + (damping * diagonal + least)[..., None] * np.eye(matrix.shape[-1]))


def linearise(W: Array, h: Array, bundle: Bundle, loss: Loss, prior: Prior) -> System:
    """Gauss-Newton's normal equations of `energy`, the loss by its weights, the prior's plane held."""
    K, _, p = W.shape
    motion = bundle.motion
    A, b, B, e = derivatives(W, bundle)
    w = h * loss.weight((e**2).sum(axis=1))
    Aw = A * w[:, None, None]
    flat = A.reshape(K, POSE, 2 * p)
    views = np.zeros((POSE * K + 1, POSE * K + 1))
    blocks = views[:-1, :-1].reshape(K, POSE, K, POSE)
    k = np.arange(K)
    blocks[k, :, k] = Aw.reshape(K, POSE, 2 * p) @ flat.transpose(0, 2, 1)
    weighted = w[:, None] * e
    right = np.empty(POSE * K + 1)
    right[:-1] = -(flat @ weighted.reshape(K, 2 * p, 1)).ravel()
    held = np.isinf(prior.focal) or bundle.kappa == 0
    if held:
        b, views[-1, -1] = np.zeros_like(b), 1.0
    views[-1, :-1] = (Aw.reshape(K, POSE, 2 * p) @ b.reshape(K, 2 * p, 1)).ravel()
    views[:-1, -1] = views[-1, :-1]
    right[-1] = -(b * weighted).sum()
    if not held:
        views[-1, -1] += (w[:, None] * b * b).sum() + prior.focal
        right[-1] -= prior.focal * np.log(bundle.kappa / prior.kappa)
    between = np.empty((p, POSE * K + 1, 3))
    between[:, :-1] = np.einsum("kacp,kdcp->pkad", Aw, B).reshape(p, POSE * K, 3)
    between[:, -1] = np.einsum("kcp,kdcp->pd", w[:, None] * b, B)
    points = np.einsum("kdcp,kecp->pde", w[:, None, None] * B, B)
    right_points = -np.einsum("kdcp,kcp->pd", B, weighted)
    off, slope, longer = off_plane(motion.shape, bundle.kappa)
    points += prior.depth * slope[:, :, None] * slope[:, None]
    right_points -= prior.depth * off[:, None] * slope
    if not held:
        views[-1, -1] += prior.depth * longer @ longer
        right[-1] -= prior.depth * longer @ off
        between[:, -1] += prior.depth * longer[:, None] * slope
    for fixed in FIXED:
        views[fixed], views[:, fixed], right[fixed], between[:, fixed] = 0.0, 0.0, 0.0, 0.0
        views[fixed, fixed] = 1.0
    return System(views, between, points, right, right_points)
