"""Rigid bundle adjustment: poses by Levenberg-Marquardt, points by least squares, in turn, with the exact camera."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RigidMotion, rms_radius
from reconstruction.camera import Camera, quaternion_from_rotation, rotation_from_quaternion
from reconstruction.state import State
from reconstruction.window.energy import Energy, pose_energy
from reconstruction.window.solver import Solver, minimise
from reconstruction.window.statistics import Statistics, statistics_of_frames

POSES = Solver(iterations=10, tolerance=1e-4)


def bundle_adjust(
    W: Array,
    visible: Mask,
    motion: RigidMotion,
    camera: Camera,
    *,
    sweeps: int = 30,
) -> tuple[RigidMotion, float]:
    """Improve shape and poses over observations (F, 2, p) px with visibility (F, p).

    Args:
        W: (F, 2, p) px; anything where not visible.
        visible: (F, p).
        motion: where to start.
        camera: the camera.
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
        motion = replace(motion, shape=solve_points(W, h, motion, camera))
    return motion, reprojection_rms(W, h, motion, camera)


def adjust_poses(W: Array, h: Array, motion: RigidMotion, camera: Camera, energy: Energy) -> tuple[RigidMotion, float]:
    """Poses given the shape, and the energy reached; W (F, 2, p) relative to the principal point."""
    radius = rms_radius(motion.shape)
    start = State(quaternion_from_rotation(motion.R), motion.t / radius, np.log(motion.s), np.zeros((len(W), 3, 0)))
    found = minimise(energy, pose_data(W, h, motion.shape, camera), start, None, POSES)
    end = found.state
    motion = RigidMotion(motion.shape, rotation_from_quaternion(end.q), np.exp(end.log_s), end.t * radius)
    return motion, float(found.value.sum())


def pose_data(W: Array, h: Array, shape: Array, camera: Camera) -> Statistics:
    """What points (F, 2, p) relative to the principal point say about the poses of a shape (3, p), in units of its size."""
    radius = rms_radius(shape)
    basis = np.concatenate([shape / radius, np.ones((1, shape.shape[1]))])
    return statistics_of_frames(basis, W / radius, h, camera.focal_px / radius)


def solve_points(W: Array, h: Array, motion: RigidMotion, camera: Camera) -> Array:
    """Shape (3, p), centred, given the poses: one small linear system a point, exact also under perspective."""
    A = motion.s[:, None, None] * motion.R
    rows = A[:, :2, :, None] - (W / camera.focal_px)[:, :, None] * A[:, 2, None, :, None]  # (F, 2, 3, p)
    weighted = rows * h[:, None, None]
    gram = np.einsum("fcip,fcjp->pij", weighted, rows, optimize=True)
    right = np.einsum("fcip,fcp->pi", weighted, W - motion.t[:, :, None], optimize=True)
    damping = 1e-6 * np.trace(gram, axis1=1, axis2=2).mean() / 3 * np.eye(3)  # keeps points seen once or twice in place
    shape = np.linalg.solve(gram + damping, (right + (damping @ motion.shape).T)[:, :, None])[:, :, 0].T
    return shape - shape.mean(axis=1, keepdims=True)


def reprojection_rms(W: Array, h: Array, motion: RigidMotion, camera: Camera) -> float:
    """RMS distance in pixels between observations (F, 2, p) relative to the principal point and the rigid shape."""
    seen = motion.s[:, None, None] * motion.R @ motion.shape
    image = (seen[:, :2] + motion.t[:, :, None]) / (1 + seen[:, 2:] / camera.focal_px)
    return float(np.sqrt((((W - image) * h[:, None]) ** 2).sum() / h.sum()))
