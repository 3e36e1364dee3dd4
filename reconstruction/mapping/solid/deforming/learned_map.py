"""The map of a solid that deforms, with what its keyframes tell of its deformations."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import rotation_from_quaternion
from reconstruction.mapping.map import Map
from reconstruction.mapping.outliers import without_outliers
from reconstruction.mapping.solid.bundle import seen_by
from reconstruction.mapping.solid.deforming.deformations import Learned
from reconstruction.mapping.solid.deforming.learning import POINTS, learned
from reconstruction.mapping.solid.deforming.own_motion import own_motion
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.settings import MOST_MODES, Settings
from reconstruction.state import State, join
from reconstruction.window.energy import build_energy
from reconstruction.window.robust import lengths
from reconstruction.window.statistics import residuals
from reconstruction.window.window import SlidingWindow

HIDDEN = 0.15  # of what keyframes show, to see whether it is predicted
TRIAL = 4  # rounds after which that is plain
COMPARED = 0.75  # quantile: a deformation may be in one place only, and a tenth may be gross errors
BETTER = 0.5  # times what the rigid shape is off there: drifting points of a rigid thing are predicted to 0.66 of it


def with_deformations(found: Map, settings: Settings, W: Array, visible: Mask, frames: Indices) -> Map:
    """A solid's map with its deformations, if these predict what keyframes show in points that they are not learned from.

    Args:
        found: the map of keyframes,
        settings: and how to reconstruct; a deformation, pull to rest or smoothness that was asked for stays.
        W: (K, 2, p) px the keyframes; anything where not visible.
        visible: (K, p).
        frames: (K,) their numbers.
    """
    if settings.deformation not in ("auto", "general") or settings.priors.keys() & {"rest", "smoothness"}:
        return found
    order = np.argsort(frames)
    W, visible = np.where(visible[:, None], W, 0.0)[order], visible[order]
    motion = found.rest.motion.in_order(order)
    rigid = seen_by(found.camera, motion) - W
    moves = own_motion(rigid / motion.s[:, None, None], without_outliers(W, visible))
    model = replace(found, modes=MOST_MODES, model=None).modelled(settings, own_motion=moves)
    some = well_spread(model.B[:3], visible, POINTS)
    few, part = model.of_points(some), (W[:, :, some], visible[:, some])
    motion = replace(motion, shape=motion.shape[:, some])
    try:
        state = followed(few, settings, motion, *part)
        if not predicted(few, *part, state, lengths(rigid[:, :, some])):
            return found
        return about(found, model, learned(model, W, visible, state), np.argsort(order))
    except np.linalg.LinAlgError:  # of points that lie as none do
        return found


def followed(model: Model, settings: Settings, motion: RigidMotion, W: Array, visible: Mask) -> State:
    """Pose and Λ' of keyframes (K, 2, p) px, visible (K, p), one after the other in their order (n = K)."""
    window = SlidingWindow(model, build_energy(model, "general", settings.priors), settings.window, motion)
    states = []
    for one, seen in zip(W, visible, strict=True):
        window.advance(one, seen)
        assert window.state is not None
        states.append(window.state[-1:])
    return join(states)


def predicted(model: Model, W: Array, visible: Mask, state: State, rigid_px: Array) -> bool:
    """Whether deformations predict hidden points much better than the rigid shape, which is off by (K, p) px, fits them."""
    hidden = visible & (np.random.default_rng(0).random(visible.shape) < HIDDEN)
    if not hidden.any():
        return False
    found = learned(model, W, visible & ~hidden, state, TRIAL)
    off = lengths(residuals(found.B, model.normalised(W), found.state.matrices(), model.focal)) * model.radius_px
    return bool(np.quantile(off[hidden], COMPARED) < BETTER * np.quantile(rigid_px[hidden], COMPARED))


def about(found: Map, model: Model, known: Learned, back: Indices) -> Map:
    """The map about another rest shape, with its keyframes' poses put back in the map's order."""
    Phi, state = model.basis.Phi, known.state
    shape = model.radius * Phi @ known.B[:3]
    R, s = rotation_from_quaternion(state.q) @ Phi.T, model.scale * np.exp(state.log_s)
    motion = RigidMotion(shape, R, s, model.radius_px * state.t).in_order(back)
    rest = replace(found.rest, motion=motion)
    model = Model(replace(model.basis, rest=shape), model.mesh, model.camera, float(motion.s[0]))
    return replace(found, rest=rest, modes=len(model.basis.eigenvalues), model=model, deformations=known.deformations)
