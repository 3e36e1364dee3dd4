"""The first model, by the first frames alone: a rigid shape or a flat sheet, and the focal length they hold (paper §4)."""

from dataclasses import replace

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.mapping import focal, rest_shape
from reconstruction.mapping.evidence import TURN_DEGREES, weigh
from reconstruction.mapping.factorization import view_turn_degrees
from reconstruction.mapping.map import Map
from reconstruction.mapping.outliers import without_outliers
from reconstruction.settings import Settings

FEWEST_RIGID = 10  # frames


def bootstrap(W: Array, visible: Mask, camera: Camera, settings: Settings, last: bool) -> Map | None:
    """The model that the first frames W (F, 2, p) px, visible (F, p) hold; None where more frames may tell.

    Args:
        W: anything where not visible.
        visible: (F, p).
        camera: its focal length may be a guess, if it is to be estimated.
        settings: which rest shape is wanted, and from how many frames.
        last: whether there will be no more frames.

    Raises:
        ReconstructionError: no rest shape can be had from them.
    """
    visible = without_outliers(W, visible)
    kind = settings.rest_shape
    if kind == "plane":
        return with_focal(rest_shape.plane(W, visible, camera), W, visible, camera, settings)
    if kind == "rigid" and settings.bootstrap_frames != "auto":
        return with_focal(rest_shape.rigid(W, visible, camera), W, visible, camera, settings)
    doubt = "there are too few frames for a rigid shape"
    if len(W) >= FEWEST_RIGID:
        doubt = weigh(W, visible).doubt
        if not doubt:
            rest = rest_shape.rigid(W, visible, camera)
            turn = view_turn_degrees(rest.motion.R)
            if kind == "rigid" or turn >= TURN_DEGREES:
                return with_focal(rest, W, visible, camera, settings)
            # Things that move by themselves pass for parallax until perspective is reckoned with.
            doubt = f"the object turned {turn:.1f}° in {len(W)} frames, about {TURN_DEGREES:.0f}° are needed"
    if not last:
        return None
    if kind == "rigid":
        raise ReconstructionError(f"cannot recover a rest shape: {doubt}", "rest_shape")
    found = with_focal(rest_shape.plane(W, visible, camera), W, visible, camera, settings)
    return replace(found, rest=replace(found.rest, note=f"{found.rest.note} (no rigid shape: {doubt})"))


def with_focal(rest: RestShape, W: Array, visible: Mask, camera: Camera, settings: Settings) -> Map:
    """A rest shape with the focal length that frames W (F, 2, p) px hold, found again by it if it is another one."""
    if not (settings.estimate_focal and camera.perspective):
        return Map(rest, camera)
    found = focal.estimate(W, visible, camera, rest, settings.deformation, settings.priors)
    camera = replace(camera, focal_px=found.focal_px)
    if found.known:
        rest = (rest_shape.rigid if rest.kind == "rigid" else rest_shape.plane)(W, visible, camera)
    return Map(rest, camera, focal_note=found.note)
