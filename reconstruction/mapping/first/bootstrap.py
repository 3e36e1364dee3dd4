"""The first model, by the first frames alone: a rigid shape or a flat sheet (paper §4)."""

from dataclasses import replace

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RestShape, RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.first import rest_shape
from reconstruction.mapping.first.evidence import TURN_DEGREES, weigh
from reconstruction.mapping.first.factorization import Factorization, view_turn_degrees
from reconstruction.mapping.keyframes import FEWEST_SEEN
from reconstruction.mapping.map import ASSUMED, Map
from reconstruction.mapping.outliers import without_outliers
from reconstruction.settings import Settings

FEWEST_RIGID = 10  # frames
SURELY_RIGID = 0.03  # least over largest eigenvalue of the metric upgrade: solids have 0.04 to 0.3, what deforms often less


def bootstrap(W: Array, visible: Mask, camera: Camera, settings: Settings, last: bool) -> Map | None:
    """The model that the first frames W (F, 2, p) px, visible (F, p) hold; None where more frames may tell.

    Args:
        W: anything where not visible.
        visible: (F, p).
        camera: its focal length is taken as it is.
        settings: which rest shape is wanted, and from how many frames.
        last: whether there will be no more frames.

    Raises:
        ReconstructionError: no rest shape can be had from them.
    """
    shown = visible.sum(axis=1)
    telling = shown >= FEWEST_SEEN * shown.max()
    W, visible = W[telling], without_outliers(W[telling], visible[telling])
    kind = settings.rest_shape
    if kind in ("plane", "sheet"):
        return first_map(rest_shape.plane(W, visible, camera), camera, settings)
    if kind == "rigid" and settings.bootstrap_frames != "auto":
        return first_map(rest_shape.rigid(W, visible, camera), camera, settings)
    doubt = "there are too few frames for a rigid shape"
    if len(W) >= FEWEST_RIGID:
        try:
            found = weigh(W, visible)
            doubt = found.doubt
            if not doubt:
                rest = rest_shape.rigid(W, visible, camera)
                doubt = deforms(rest.motion, found.factorization)
                if kind == "rigid" or not doubt:
                    return first_map(rest, camera, settings)
        except ReconstructionError as error:  # frames of too few points in common
            doubt = str(error).removeprefix("cannot recover a rest shape: ")
    if not last:
        return None
    if kind == "rigid":
        raise ReconstructionError(f"cannot recover a rest shape: {doubt}", "rest_shape")
    rest = rest_shape.plane(W, visible, camera)
    return first_map(replace(rest, note=f"{rest.note} (no rigid shape: {doubt})"), camera, settings)


def deforms(motion: RigidMotion, found: Factorization) -> str:
    """Why that may deform which first frames take for a rigid shape; empty if it surely is one.

    Args:
        motion: with perspective reckoned with: until then, things that move by themselves pass for parallax.
        found: without it.
    """
    frames, turn = len(motion.R), view_turn_degrees(motion.R)
    if turn < TURN_DEGREES:
        return f"the object turned {turn:.1f}° in {frames} frames, about {TURN_DEGREES:.0f}° are needed"
    if found.metric_condition < SURELY_RIGID:
        return f"a rigid shape would explain {frames} frames only by motion too strange: the object may deform"
    return ""


def first_map(rest: RestShape, camera: Camera, settings: Settings) -> Map:
    """The map of a rest shape; first frames hardly hold a focal length."""
    if not (settings.estimate_focal and camera.perspective):
        return Map(rest, camera)
    return Map(rest, camera, focal_note=ASSUMED.format(camera.focal_px))
