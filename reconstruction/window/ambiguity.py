"""Branches that look alike in one picture, a surface bent or tilted otherwise: where else to start, and what changed.

Frontal poses are saddle points, and edge lengths make the energy of Λ non-convex, so that the solver finds the branch that
its start is on; only the energy tells which is right.
"""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import (
    nearest_rotation,
    quaternion_exp,
    quaternion_from_rotation,
    quaternion_product,
    rotation_from_quaternion,
)
from reconstruction.estimate import SAME_BEND, SAME_TILT_DEGREES, Switch
from reconstruction.state import State
from reconstruction.window.energy import pose_energy
from reconstruction.window.solver import Solution, Solver, minimise
from reconstruction.window.statistics import image_statistics

FACING = 0.05  # radians within which a shape's main plane faces the camera
LEAN = 0.1  # radians by which it is tilted then
FLAT = 0.05  # share of a shape's extent along its main axis, below which an affine view of it tells no slope
CLEARLY_BETTER = 0.5  # times the energy of the pose at the start
OTHER_BENDS = (np.zeros((3, 1)), np.array([[1.0], [1.0], [-1.0]]))  # factors on the rows of Λ: undeformed, bent back


def switch_between(left: Solution, found: Solution) -> Switch | None:
    """The switch from one branch to another, by their newest frames; None if those are the same but for details."""
    bends = left.state.Lambda[-1, 2], found.state.Lambda[-1, 2]
    size = np.linalg.norm(bends[0]) * np.linalg.norm(bends[1])
    bend = float(bends[0] @ bends[1] / size) if size > 0 else 1.0
    turned = float(np.rad2deg(2 * np.arccos(min(1.0, abs(left.state.q[-1] @ found.state.q[-1])))))
    if bend >= SAME_BEND and turned <= SAME_TILT_DEGREES:
        return None
    return Switch(bend, turned, float(found.value.sum() / left.value.sum()))


def first_pose(model: Model, motion: RigidMotion, W: Array, visible: Mask, rest: Array) -> State:
    """Pose of a frame by itself, nothing deformed: from that of the bootstrap, or as its image is nearest to.

    The latter where that explains the image clearly better: a solid that was lost may have turned to anywhere.

    Args:
        model: the rest shape and its modes.
        motion: how the rest shape is seen in the first frame.
        W: (2, p) px.
        visible: (p,) which points to use.
        rest: Λ̄' (3, r) of the undeformed shape.
    """
    data = image_statistics(model, W, visible.astype(np.float64), rigid=True)
    shape, seen = motion.shape[:, visible], W[:, visible] - model.camera.center_px[:, None]
    centre = seen.mean(axis=1, keepdims=True)
    nearest = (seen - centre) @ np.linalg.pinv(shape - shape.mean(axis=1, keepdims=True), rcond=FLAT)  # affine resection
    best: Solution | None = None
    for R in (motion.R[0], nearest_rotation(np.vstack([nearest, np.zeros(3)]))):
        log_s = np.log(np.sqrt(np.var(seen, axis=1).sum() / np.var((R @ shape)[:2], axis=1).sum()) / model.scale)
        q = quaternion_from_rotation(R @ model.basis.Phi)
        start = State(q[None], centre.T / model.radius_px, np.array([log_s]), np.zeros((1, 3, 0)))
        found = minimise(pose_energy(model.camera), data, start, None, Solver())
        if best is None or found.value[0] < CLEARLY_BETTER * best.value[0]:
            best = found
    assert best
    return replace(best.state, Lambda=rest[None].copy())


def off_the_saddle(last: State, model: Model) -> State:
    """Where the frame after `last` (n = 1) starts: there, but tilted a little if it faces an orthographic camera.

    Facing it, the image's derivatives with respect to tilt and bending are zero, and the solver would never leave. (At
    constant velocity a tilt would overshoot into the mirrored branch.)
    """
    facing = abs(float(rotation_from_quaternion(last.q)[0, 2, 2]))
    if model.camera.perspective or facing < np.cos(FACING):
        return last
    return replace(last, q=quaternion_product(quaternion_exp(np.array([[LEAN, 0.0, 0.0]])), last.q))


def other_bend(state: State, factors: Array, rest: Array) -> State:
    """The state with the newest frame's Λ' about the rest shape Λ̄' (3, r) multiplied by factors (3, 1)."""
    Lambda = state.Lambda.copy()
    Lambda[-1] = rest + factors * (Lambda[-1] - rest)
    return replace(state, Lambda=Lambda)
