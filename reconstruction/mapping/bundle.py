"""Rigid bundle adjustment: all poses, all points and the focal length at once, by Levenberg-Marquardt.

A point X seen with scale s, rotation R and image translation t, κ = 1/f:

    Y = s R X,    d = 1 + κ Y_z,    u = (Y_xy + t)/d

Derivatives with u fixed in the last factor: ∂u/∂Y = [1, 0, −κu_x; 0, 1, −κu_y]/d, ∂u/∂t = 1/d, ∂u/∂log κ = −κ u Y_z/d, and for
a turn θ applied on the left ∂Y/∂θ = −[Y]×, ∂Y/∂log s = Y, ∂Y/∂X = sR. κ = 0 is the orthographic camera. Points are
eliminated (Schur complement), so that a step is one matrix product over the points and one small dense system.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.camera import quaternion_exp, rotation_from_quaternion
from reconstruction.mapping.rigid import RigidMotion

Array = NDArray[np.float64]

POSE = 6  # θ, t, log s of a view
NEAREST = 0.1  # a point's depth over its view's, closer than which no point may come to the camera
GIVING_UP = 1e6  # damping at which no step helps any more


@dataclass(frozen=True)
class Bundle:
    """A rigid shape and its views.

    Attributes:
        motion: shape (3, p) and K poses.
        kappa: 1/focal length, in one over the shape's units; 0 for an orthographic camera.
    """

    motion: RigidMotion
    kappa: float

    def placed(self) -> Array:
        """Y (K, 3, p): the shape turned and scaled."""
        m = self.motion
        return np.asarray((m.s[:, None, None] * m.R) @ m.shape)

    def image(self, placed: Array | None = None) -> Array:
        """u (K, 2, p) relative to the principal point."""
        Y = self.placed() if placed is None else placed
        return np.asarray((Y[:, :2] + self.motion.t[:, :, None]) / (1 + self.kappa * Y[:, 2:]))

    def moved(self, poses: Array, log_kappa: float, points: Array) -> "Bundle":
        """After a step: poses (K, 6) as θ, t, log s; points (3, p)."""
        m = self.motion
        R = rotation_from_quaternion(quaternion_exp(poses[:, :3])) @ m.R
        motion = RigidMotion(m.shape + points, R, m.s * np.exp(poses[:, 5]), m.t + poses[:, 3:5])
        return Bundle(motion, self.kappa * float(np.exp(log_kappa)))

    def __getitem__(self, views: NDArray[np.int64]) -> "Bundle":
        m = self.motion
        return Bundle(RigidMotion(m.shape, m.R[views], m.s[views], m.t[views]), self.kappa)


@dataclass(frozen=True)
class Loss:
    """A robust loss of a residual's length e (2-D): Geman-McClure ½ c²e²/(c² + e²), or soft-L1 c²(√(1 + e²/c²) − 1).

    Attributes:
        scale: c, where it leaves the parabola.
        redescending: Geman-McClure: what is far off counts for nothing.
    """

    scale: float
    redescending: bool

    def value(self, squares: Array) -> Array:
        """Loss of e²."""
        x = squares / self.scale**2
        return np.asarray(self.scale**2 * (0.5 * x / (1 + x) if self.redescending else np.sqrt(1 + x) - 1))

    def weight(self, squares: Array) -> Array:
        """Its derivative by e²/2."""
        x = squares / self.scale**2
        return np.asarray((1 + x) ** -2.0 if self.redescending else (1 + x) ** -0.5)


@dataclass(frozen=True)
class Prior:
    """What is believed before: a point is not far off the shape's plane, and the focal length is about as given.

    ½ depth Σ_i d_i² + ½ focal (log κ − log κ₀)², d_i the point's distance, along the first view's axis, from the
    plane z = a x + b y + c through all.

    Attributes:
        depth: weight of a depth; 0 for none.
        focal: weight of the focal length; infinite keeps it.
        kappa: κ₀.
    """

    depth: float
    focal: float
    kappa: float

    def value(self, bundle: Bundle) -> float:
        """The energy."""
        off = off_plane(bundle.motion.shape)
        change = np.log(bundle.kappa / self.kappa) if np.isfinite(self.focal) and self.kappa > 0 else 0.0
        return float(0.5 * self.depth * off @ off + (0.5 * self.focal * change**2 if change else 0.0))


@dataclass(frozen=True)
class Adjustment:
    """What a call of `adjust` may change.

    Attributes:
        steps: most iterations.
        tolerance: relative gain below which it stops.
        points: whether the shape is free, too.
    """

    steps: int = 30
    tolerance: float = 1e-4
    points: bool = True


def off_plane(shape: Array) -> Array:
    """Distances (p,) along z of a shape (3, p) from the plane z = a x + b y + c through it.

    Not along the plane's normal: a shape could lean over to come nearer to it.
    """
    plane = np.concatenate([shape[:2], np.ones((1, shape.shape[1]))])
    coefficients = np.linalg.lstsq(plane.T, shape[2], rcond=None)[0]
    return np.asarray(shape[2] - coefficients @ plane)


def adjust(W: Array, h: Array, bundle: Bundle, loss: Loss, prior: Prior, how: Adjustment) -> tuple[Bundle, float]:
    """Minimise Σ h ρ(‖u − W‖) + prior.

    The first view keeps its turn and scale: they are the shape's axes and unit.

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
            tried = bundle.moved(*(system.step(damping) if how.points else system.pose_step(damping)))
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
    """What `adjust` minimises; infinite with a point too close to the camera."""
    Y = bundle.placed()
    if bundle.kappa * Y[:, 2].min() < NEAREST - 1:
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

    def step(self, damping: float) -> tuple[Array, float, Array]:
        """Poses (K, 6), log κ, points (3, p)."""
        points = damped(self.points, damping)
        inverse = np.linalg.inv(points)
        carried = self.between @ inverse  # (p, n, 3)
        n = len(self.right_views)
        flat = [x.transpose(1, 0, 2).reshape(n, -1) for x in (carried, self.between)]
        schur = damped(self.views, damping) - flat[0] @ flat[1].T
        d = np.linalg.solve(schur, self.right_views - flat[0] @ self.right_points.ravel())
        back = self.right_points - (flat[1].T @ d).reshape(-1, 3)
        return d[:-1].reshape(-1, POSE), float(d[-1]), (inverse @ back[:, :, None])[:, :, 0].T

    def pose_step(self, damping: float) -> tuple[Array, float, Array]:
        """The same with shape and focal length held."""
        n = len(self.right_views) - 1
        d = np.linalg.solve(damped(self.views[:n, :n], damping), self.right_views[:n])
        return d.reshape(-1, POSE), 0.0, np.zeros(self.right_points.T.shape)


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
    points[:, 2, 2] += prior.depth
    right_points[:, 2] -= prior.depth * off_plane(motion.shape)
    for fixed in (0, 1, 2, 5):  # the first view's turn and scale
        views[fixed], views[:, fixed], right[fixed], between[:, fixed] = 0.0, 0.0, 0.0, 0.0
        views[fixed, fixed] = 1.0
    return System(views, between, points, right, right_points)


def derivatives(W: Array, bundle: Bundle) -> tuple[Array, Array, Array, Array]:
    """∂u/∂pose (K, 6, 2, p), ∂u/∂log κ (K, 2, p), ∂u/∂X (K, 3, 2, p), and the residuals u − W (K, 2, p)."""
    K, _, p = W.shape
    m, kappa = bundle.motion, bundle.kappa
    Y = bundle.placed()
    inverse = 1 / (1 + kappa * Y[:, 2])
    u = bundle.image(Y)
    slope = -kappa * u  # ∂u/∂Y_z times d
    A = np.zeros((K, POSE, 2, p))
    A[:, 0, 0], A[:, 0, 1] = slope[:, 0] * Y[:, 1], -Y[:, 2] + slope[:, 1] * Y[:, 1]
    A[:, 1, 0], A[:, 1, 1] = Y[:, 2] - slope[:, 0] * Y[:, 0], -slope[:, 1] * Y[:, 0]
    A[:, 2, 0], A[:, 2, 1] = -Y[:, 1], Y[:, 0]
    A[:, 3, 0] = A[:, 4, 1] = 1.0
    A[:, 5] = Y[:, :2] + slope * Y[:, 2:]
    A *= inverse[:, None, None]
    turned = (m.s[:, None, None] * m.R).transpose(0, 2, 1)  # (K, 3 of X, 3 of Y)
    B = turned[:, :, :2, None] + turned[:, :, 2:, None] * slope[:, None]
    return A, slope * Y[:, 2:] * inverse[:, None], B * inverse[:, None, None], u - W


def scaled(bundle: Bundle, factor: float) -> Bundle:
    """The same in other units: lengths times `factor`."""
    m = bundle.motion
    return Bundle(replace(m, shape=m.shape * factor, t=m.t * factor), bundle.kappa / factor)
