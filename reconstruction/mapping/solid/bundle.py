"""A rigid shape and its views: image, derivatives, robust loss and priors.

A point X seen with scale s, rotation R and image translation t, κ = 1/f:

    Y = s R X,    d = 1 + κ Y_z,    u = (Y_xy + t)/d

Derivatives: ∂u/∂Y = [1, 0, −κu_x; 0, 1, −κu_y]/d, ∂u/∂t = 1/d, ∂u/∂log κ = −κ u Y_z/d, and for a turn θ applied on the left
∂Y/∂θ = −[Y]×, ∂Y/∂log s = Y, ∂Y/∂X = sR. κ = 0 is the orthographic camera.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reconstruction.arrays import Array, Indices
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera, farness, quaternion_exp, rotation_from_quaternion
from reconstruction.mapping.first.evidence import extent

POSE = 6  # θ, t, log s of a view
HALF_WIDTH = 0.5  # relief over width that is as deep as is believed without proof
PROOF = 0.01  # share of the residuals that twice that relief must explain
LOOSE = 0.3  # of one observation, says that a point is no deeper
FARTHEST = 3.0  # RMS radii from the middle; of most solids no point is farther than two
APART = 0.1  # of its observations, says that a point is no farther, for each radius
FOCAL_DOUBT = 0.3  # deviation of log focal length, believed as one part in FOCAL_PROOF of the observations
FOCAL_PROOF = 0.01


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
        """Points u (K, 2, p) relative to the principal point."""
        Y = self.placed() if placed is None else placed
        return np.asarray((Y[:, :2] + self.motion.t[:, :, None]) / self.farness(Y)[:, None])

    def farness(self, placed: Array) -> Array:
        """Depths (K, p) of points Y (K, 3, p) over their views', at least `NEAREST`: less where nothing is seen alone."""
        return farness(placed, self.kappa)

    def reversed(self) -> "Bundle":
        """The same with its depth reversed, which explains distant views as well."""
        return Bundle(self.motion.mirrored(), self.kappa)

    def centred(self) -> "Bundle":
        """The same about the shape's middle, as large as in the first view: nothing of the images changes.

        A shape half as far away and half as large looks the same, and steps may go that way for ever. The middle is that of
        most points: single ones may be anywhere.
        """
        m = self.motion
        middle = np.median(m.shape, axis=1)
        origin = m.s[:, None] * (m.R @ middle)
        farther = 1 + self.kappa * origin[:, 2]
        s = m.s / farther
        t = (m.t + origin[:, :2]) / farther[:, None]
        return Bundle(RigidMotion(s[0] * (m.shape - middle[:, None]), m.R, s / s[0], t), self.kappa)

    def moved(self, poses: Array, log_kappa: float, points: Array) -> "Bundle":
        """After a step: poses (K, 6) as θ, t, log s; points (3, p)."""
        m = self.motion
        R = rotation_from_quaternion(quaternion_exp(poses[:, :3])) @ m.R
        motion = RigidMotion(m.shape + points, R, m.s * np.exp(poses[:, 5]), m.t + poses[:, 3:5])
        return Bundle(motion, self.kappa * float(np.exp(log_kappa)))

    def __getitem__(self, views: Indices) -> "Bundle":
        m = self.motion
        return Bundle(RigidMotion(m.shape, m.R[views], m.s[views], m.t[views]), self.kappa)


def seen_by(camera: Camera, motion: RigidMotion) -> Array:
    """Image (K, 2, p) px of a rigid shape in its poses."""
    return Bundle(motion, 1 / camera.focal_px).image() + camera.center_px[:, None]


@dataclass(frozen=True)
class Loss:
    """A robust loss of a residual's length e (2-D): Geman-McClure ½ c²e²/(c² + e²), or soft-L1 c²(√(1 + e²/c²) − 1).

    Attributes:
        scale: c, where it leaves the parabola; one, or of each point (p,).
        redescending: Geman-McClure: what is far off counts for nothing.
    """

    scale: float | Array
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
    """What is believed before: no point is far off the shape's plane, or from the rest, and the focal length is as given.

    ½ depth Σ_i d_i²/(1 + κ z_i)² + ½ apart Σ_i b_i² + ½ focal (log κ − log κ₀)², d_i the point's distance, along the first
    view's axis, from the plane z = a x + b y + c through all, by the distance from the camera: to be nearer and smaller
    gains nothing; b_i as `beyond_all` has it.

    Attributes:
        depth: weight of a depth; 0 for none.
        apart: weight of being far from the rest, where what bends would rather be; 0 for none.
        focal: weight of the focal length; infinite keeps it.
        kappa: κ₀.
    """

    depth: float
    apart: float
    focal: float
    kappa: float

    def value(self, bundle: Bundle) -> float:
        """The energy."""
        off = off_plane(bundle.motion.shape, bundle.kappa)[0]
        beyond = beyond_all(bundle.motion.shape, bundle.kappa)[0]
        change = np.log(bundle.kappa / self.kappa) if np.isfinite(self.focal) and self.kappa > 0 else 0.0
        value = self.depth * off @ off + self.apart * beyond @ beyond
        return float(0.5 * value + (0.5 * self.focal * change**2 if change else 0.0))


def off_plane(shape: Array, kappa: float) -> tuple[Array, Array, Array]:
    """d/(1 + κ z) (p,) of a shape (3, p), see `Prior`; its derivatives (3, p) by each point, plane held, and (p,) by log κ.

    Not along the plane's normal: a shape could lean over to come nearer to it.
    """
    nearness = 1 / (1 + kappa * shape[2])
    plane = nearness * np.concatenate([shape[:2], np.ones((1, shape.shape[1])), shape[2:]])
    a, b, c = np.linalg.solve(plane[:3] @ plane[:3].T, plane[:3] @ plane[3])
    off = plane[3] - a * plane[0] - b * plane[1] - c * plane[2]
    slope = nearness * np.array([[-a], [-b], [1.0]])
    slope[2] -= kappa * nearness * off
    return np.asarray(off), slope, np.asarray(-kappa * shape[2] * nearness * off)


def beyond_all(shape: Array, kappa: float) -> tuple[Array, Array]:
    """How much farther than `FARTHEST` points (3, p) are from the middle, (p,), and its derivatives (3, p), middle held.

    Over the middle's distance from the camera: here, too, to be nearer and smaller gains nothing.
    """
    middle = np.median(shape, axis=1, keepdims=True)
    nearness = 1 / (1 + kappa * middle[2])
    away = nearness * (shape - middle)
    radius = np.linalg.norm(away, axis=0)
    beyond = np.maximum(radius - FARTHEST, 0.0)
    return beyond, np.where(beyond > 0, nearness * away / np.maximum(radius, FARTHEST), 0.0)


def prior_of(bundle: Bundle, h: Array, sigma: float, kappa: float, *, refine: bool) -> Prior:
    """Depths of half the width, the focal length as given; both as weak as so many observations of that noise."""
    shape = bundle.motion.shape
    deep = HALF_WIDTH * extent(shape[:2])
    excess = float((off_plane(shape, bundle.kappa)[0] ** 2).mean()) / deep**2
    depth = (LOOSE + PROOF * h.sum() / len(shape.T) * excess) * (sigma / deep) ** 2
    focal = FOCAL_PROOF * h.sum() * (sigma / FOCAL_DOUBT) ** 2 if refine and kappa else np.inf
    return Prior(depth, APART * h.sum() / len(shape.T) * sigma**2, focal, kappa)


@dataclass(frozen=True)
class Derivatives:
    """Of the images, where a bundle is; each worked out when it is asked for."""

    bundle: Bundle

    @cached_property
    def image(self) -> Array:
        """Points u (K, 2, p)."""
        return self.bundle.image(self._placed)

    @cached_property
    def by_pose(self) -> Array:
        """∂u/∂(θ, t, log s) (K, 6, 2, p)."""
        Y, slope = self._placed, self._slope
        A = np.zeros((len(Y), POSE, 2, Y.shape[2]))
        A[:, 0, 0], A[:, 0, 1] = slope[:, 0] * Y[:, 1], -Y[:, 2] + slope[:, 1] * Y[:, 1]
        A[:, 1, 0], A[:, 1, 1] = Y[:, 2] - slope[:, 0] * Y[:, 0], -slope[:, 1] * Y[:, 0]
        A[:, 2, 0], A[:, 2, 1] = -Y[:, 1], Y[:, 0]
        A[:, 3, 0] = A[:, 4, 1] = 1.0
        A[:, 5] = Y[:, :2] + slope * Y[:, 2:]
        A *= self._nearness[:, None, None]
        return A

    @cached_property
    def by_log_kappa(self) -> Array:
        """∂u/∂log κ (K, 2, p)."""
        return np.asarray(self._slope * self._placed[:, 2:] * self._nearness[:, None])

    @cached_property
    def by_point(self) -> Array:
        """∂u/∂X (K, 3, 2, p)."""
        m = self.bundle.motion
        turned = (m.s[:, None, None] * m.R).transpose(0, 2, 1)  # (K, 3 of X, 3 of Y)
        B = turned[:, :, :2, None] + turned[:, :, 2:, None] * self._slope[:, None]
        B *= self._nearness[:, None, None]
        return np.asarray(B)

    @cached_property
    def _placed(self) -> Array:
        return self.bundle.placed()

    @cached_property
    def _nearness(self) -> Array:
        return np.asarray(1 / self.bundle.farness(self._placed))

    @cached_property
    def _slope(self) -> Array:
        """∂u/∂Y_z times d."""
        return np.asarray(-self.bundle.kappa * self.image)


def scaled(bundle: Bundle, factor: float) -> Bundle:
    """The same in other units: lengths times `factor`."""
    m = bundle.motion
    return Bundle(replace(m, shape=m.shape * factor, t=m.t * factor), bundle.kappa / factor)
