"""The camera of tracks that nobody knows the camera of: orthographic, or in perspective."""

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.camera import Camera, lens
from reconstruction.mapping.isometric.adjustment import with_focal
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.keyframes import Keyframes, thinned
from reconstruction.mapping.map import Map
from reconstruction.mapping.maps import LONG_LENS, map_of
from reconstruction.mapping.selection import Kind

USUAL_LENS = 5.0  # focal length over the object's size, RMS: of what fills half a picture
CLEARLY = 0.85  # times what the object changes before an orthographic camera: less is proof of perspective,
FROM_FAR = 0.67  # ... if it is so much less, too, than what the same sheet changes, seen through longer and longer lenses
LONGER = 1.4  # steps to these


def likely_camera(W: Array, visible: Mask, kind: Kind | None = None) -> Camera:
    """The camera before which an object changes least, by keyframes; orthographic where they do not tell.

    What a camera in perspective sees of a sheet or solid, no orthographic one explains, and the other way round: in
    perspective the same thing would change its lengths or its shape. A sheet is also asked how much it would change seen
    from afar: with creases, which only a lens finds, it changes less, whatever sees it.

    Args:
        W: (F, 2, p) px, or normalised; anything where not visible.
        visible: (F, p).
        kind: of object, if that is known.
    """
    some = thinned(W.shape[2])
    keyframes = Keyframes()
    for k, (w, h) in enumerate(zip(W[:, :, some], visible[:, some], strict=True)):
        keyframes.offer(k, w, h)
    if not keyframes.frames:
        return Camera()
    W, visible, _ = keyframes.spread()
    near = map_of(W, visible, lens(W, USUAL_LENS), estimate_focal=True, kind=kind)
    if near and not near.sheet:  # its evidence is by the focal length assumed
        near = map_of(W, visible, near.camera, estimate_focal=False, kind=kind)
    if near is None or not (shows_perspective(near.sheet, W) if near.sheet else near.evidence and near.evidence.proven):
        return Camera()
    parallel = map_of(W, visible, Camera(), estimate_focal=False, kind=kind)
    if parallel is None:
        return Camera()
    before, after = changes(parallel, near)
    return near.camera if after < CLEARLY * before else Camera()


def shows_perspective(found: IsometricSheet, W: Array) -> bool:
    """Whether a sheet in keyframes W (F, 2, p) px changes clearly less than through a lens that sees no perspective."""
    focal_px, longest_px = found.camera.focal_px, lens(W, LONG_LENS).focal_px
    near = far = with_focal(found, focal_px)
    while focal_px < longest_px:
        focal_px = min(LONGER * focal_px, longest_px)
        far = with_focal(far, focal_px)
    return near.strain_rms < FROM_FAR * far.strain_rms


def changes(parallel: Map, near: Map) -> tuple[float, float]:
    """How much an object changes before an orthographic camera, and before one in perspective.

    Lengths of a sheet, if it is one before both; else what the kind found in perspective, a sheet told its lengths or a
    solid, leaves over before either, px: a sheet leaves less than a solid, whatever camera sees it. It leaves the noise of
    its tracks before both, which tells nothing of either.
    """
    if parallel.sheet and near.sheet:
        return parallel.sheet.strain_rms, near.sheet.strain_rms
    assert parallel.evidence
    assert near.evidence
    if near.sheet:
        noise_px = float(np.median(near.sheet.warps.noise_px))
        return beyond(parallel.evidence.told_px, noise_px), beyond(near.evidence.told_px, noise_px)
    return parallel.evidence.solid.edges_px, near.evidence.solid.edges_px


def beyond(deviation: float, noise: float) -> float:
    """What is left of a standard deviation without noise."""
    return float(np.sqrt(max(deviation**2 - noise**2, 0.0)))
