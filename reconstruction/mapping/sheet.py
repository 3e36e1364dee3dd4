"""A flat sheet as the first image shows it: everything but its tilt is in that image, and the next frames tell the tilt."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera, quaternion_exp, rotation_from_quaternion, tilt_axes
from reconstruction.mapping.rigid import poses_over_time, reprojection_rms, solve_points

TILTS_DEGREES = (20.0, 40.0, 60.0)  # looked at first, ...
DIRECTIONS = 8  # ... each so many ways; then ...
STEPS_DEGREES = (10.0, 5.0, 2.5)  # ... so far around the best
SPARE = 2  # one in so many frames is enough to compare by
APART_DEGREES = 10.0  # tilts so far from the best tell how sharply it is known


def sheet(image: Array, R: Array, camera: Camera) -> RigidMotion:
    """The flat sheet in the plane turned by R (3, 3) that looks like the image (2, p) px."""
    W = image - camera.center_px[:, None]
    t = W.mean(axis=1)
    motion = RigidMotion(np.zeros((3, W.shape[1])), R[None], np.ones(1), t[None])
    shape = solve_points(W[None], np.ones((1, W.shape[1])), motion, camera, flat=True)
    return replace(motion, shape=shape)


def best_tilted(image: Array, W: Array, visible: Mask, camera: Camera) -> tuple[RigidMotion, float]:
    """The sheet that looks like the image (2, p) px and, of all tilts, fits observations (F, 2, p) px best.

    Poses and points in turn would creep from any start to the tilt: a sheet tilted a little less fits nearly as well.

    Returns:
        the sheet, and how many times worse the best fit is with a clearly other tilt.
    """
    few = slice(None, None, SPARE)
    known, h = np.where(visible[:, None], W, 0.0)[few] - camera.center_px[:, None], visible[few].astype(np.float64)

    def tried(tilts: Array) -> tuple[RigidMotion, float, Array]:
        sheets = [sheet(image, R, camera) for R in rotation_from_quaternion(quaternion_exp(tilts))]
        motions = poses_over_time(W[few], visible[few], sheets, camera)
        errors = np.nan_to_num([reprojection_rms(known, h, motion, camera) for motion in motions], nan=np.inf)
        k = int(errors.argmin())
        return motions[k], float(errors[k]), tilts[k]

    ring = np.deg2rad(tilt_axes(DIRECTIONS))
    motion, error, tilt = tried(np.concatenate([degrees * ring for degrees in TILTS_DEGREES]))
    for step in STEPS_DEGREES:
        other = tried(tilt + step * ring)
        if other[1] < error:
            motion, error, tilt = other
    sharpness = tried(tilt + APART_DEGREES * ring)[1] / max(error, 1e-12)
    (motion,) = poses_over_time(W, visible, [replace(motion, R=motion.R[:1], s=motion.s[:1], t=motion.t[:1])], camera)
    return motion, sharpness
