"""Rigid bundle adjustment: poses by Levenberg-Marquardt, points by least squares, in turn, with the exact camera."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.camera import Camera, quaternion_from_rotation, rotation_from_quaternion
from reconstruction.energy import Energy, State
from reconstruction.solver import Solver, minimise
from reconstruction.statistics import frame_statistics, stack

Array = NDArray[np.float64]
Visibility = NDArray[np.bool_]

ORTHOGRAPHIC_SCALE = 1.0  # λ_s without depth, where only a zoom changes the scale
PERSPECTIVE_SCALE = 1e-3  # λ_s with depth, where moving towards the camera does


@dataclass(frozen=True)
class RigidMotion:
    """A rigid shape and how it is seen in F frames.

    Attributes:
        shape: (3, p) centred.
        R: (F, 3, 3) rotations.
        s: (F,) scales.
        t: (F, 2) image of the shape's origin relative to the principal point, px.
    """

    shape: Array
    R: Array
    s: Array
    t: Array

    def in_first_frame(self) -> "RigidMotion":
        """The same in camera axes and pixels of the first frame: R[0] = 1, s[0] = 1."""
        return replace(self, shape=self.s[0] * self.R[0] @ self.shape, R=self.R @ self.R[0].T, s=self.s / self.s[0])

    def mirrored(self) -> "RigidMotion":
        """Depth reversed: explains orthographic views as well."""
        flip = np.diag([1.0, 1.0, -1.0])
        return replace(self, shape=flip @ self.shape, R=flip @ self.R @ flip)


def pose_energy(camera: Camera, tied: bool = False) -> Energy:
    """The energy of a rigid shape's poses."""
    scale = PERSPECTIVE_SCALE if camera.perspective else ORTHOGRAPHIC_SCALE
    return Energy(rows=(), rest=0.0, rotation=1e-3, scale=scale, tied=tied)


def bundle_adjust(
    W: Array,
    visible: Visibility,
    motion: RigidMotion,
    camera: Camera,
    *,
    flat: bool = False,
    sweeps: int = 30,
) -> tuple[RigidMotion, float]:
    """Improve shape and poses over observations (F, 2, p) px with visibility (F, p).

    Args:
        W: (F, 2, p) px; anything where not visible.
        visible: (F, p).
        motion: where to start.
        camera: the camera.
        flat: keep the shape in its plane z = 0.
        sweeps: most turns of poses and points.

    Returns:
        the motion and its RMS reprojection error in pixels.
    """
    previous = np.inf
    energy, h = pose_energy(camera), visible.astype(np.float64)
    W = np.where(visible[:, None], W, 0.0) - camera.center_px[:, None]
    for _ in range(sweeps):
        motion, value = adjust_poses(W, h, motion, camera, energy)
        if value > previous * (1 - 1e-3):
            break
        previous = value
        motion = replace(motion, shape=solve_points(W, h, motion, camera, flat=flat))
    return motion, reprojection_rms(W, h, motion, camera)


def adjust_poses(W: Array, h: Array, motion: RigidMotion, camera: Camera, energy: Energy) -> tuple[RigidMotion, float]:
    """Poses given the shape, and the energy reached; W (F, 2, p) relative to the principal point."""
    p = motion.shape.shape[1]
    radius = float(np.sqrt((motion.shape**2).sum() / p))
    B = np.concatenate([motion.shape / radius, np.ones((1, p))])
    data = stack([frame_statistics(B, w / radius, v, camera.focal_px / radius) for w, v in zip(W, h, strict=True)])
    q = np.array([quaternion_from_rotation(R) for R in motion.R])
    start = State(q, motion.t / radius, np.log(motion.s), np.zeros((len(W), 3, 0)))
    solution = minimise(energy, data, start, None, Solver(iterations=10, tolerance=1e-4))
    end = solution.state
    return (
        RigidMotion(motion.shape, rotation_from_quaternion(end.q), np.exp(end.log_s), end.t * radius),
        float(solution.value.sum()),
    )


def solve_points(W: Array, h: Array, motion: RigidMotion, camera: Camera, *, flat: bool) -> Array:
    """Shape (3, p), centred, given the poses: one small linear system a point, exact also under perspective."""
    A = motion.s[:, None, None] * motion.R
    rows = A[:, :2, :, None] - (W / camera.focal_px)[:, :, None] * A[:, 2, None, :, None]  # (F, 2, 3, p)
    if flat:
        rows = rows[:, :, :2]
    weighted = rows * h[:, None, None]
    gram = np.einsum("fcip,fcjp->pij", weighted, rows, optimize=True)
    right = np.einsum("fcip,fcp->pi", weighted, W - motion.t[:, :, None], optimize=True)
    k = gram.shape[1]
    damping = 1e-6 * np.trace(gram, axis1=1, axis2=2).mean() / k * np.eye(k)  # keeps points seen once or twice in place
    anchor = damping @ motion.shape[:k]
    points = np.linalg.solve(gram + damping, (right + anchor.T)[:, :, None])[:, :, 0].T
    shape = np.concatenate([points, np.zeros((3 - k, points.shape[1]))])
    return np.asarray(shape - shape.mean(axis=1, keepdims=True))


def reprojection_rms(W: Array, h: Array, motion: RigidMotion, camera: Camera) -> float:
    """RMS distance in pixels between observations (F, 2, p) relative to the principal point and the rigid shape."""
    seen = motion.s[:, None, None] * motion.R @ motion.shape
    image = (seen[:, :2] + motion.t[:, :, None]) / (1 + seen[:, 2:] / camera.focal_px)
    return float(np.sqrt((((W - image) * h[:, None]) ** 2).sum() / h.sum()))
