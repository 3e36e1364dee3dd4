"""What keyframes show: which kind of object, and its map, of a solid, a flat sheet, or a sheet that bends."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.mesh import ratio_of_sizes
from reconstruction.basis.rest_shape import RestShape, RigidMotion, completed, medoid
from reconstruction.camera import Camera, lens, nearest_rotation
from reconstruction.mapping.isometric.adjustment import FEW_ROUNDS, MOST_ROUNDS, bundled, in_halves, refined, sheet
from reconstruction.mapping.isometric.focal import under_its_focal_length
from reconstruction.mapping.isometric.likeliest import likeliest
from reconstruction.mapping.isometric.sheet import USUAL_STRETCH, IsometricSheet
from reconstruction.mapping.keyframes import thinned
from reconstruction.mapping.map import ASSUMED, Map
from reconstruction.mapping.selection import Evidence, Kind, select
from reconstruction.mapping.solid.deforming.freedom import modes_held
from reconstruction.mapping.solid.rivals import HARDLY_TURNED
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.mapping.start import Start, at_once
from reconstruction.settings import MORE_MODES, MOST_MODES, USUAL_MODES

FEWEST_KEYFRAMES = 6
AGAIN = 2  # times shapes are chosen that are seen without perspective
LONG_LENS = 160.0  # focal length over the object's size, RMS, of a lens that sees as an orthographic camera does


def map_of(
    W: Array,
    visible: Mask,
    camera: Camera,
    estimate_focal: bool,
    known: Array | None = None,
    start: Start = at_once,
    given: RestShape | None = None,
    kind: Kind | None = None,
    last: Callable[[], tuple[Array, Mask]] | None = None,
) -> Map | None:
    """What keyframes W (K, 2, p) px with visibility (K, p) show, most different ones first; None where they do not tell.

    Args:
        W: NaN where not visible.
        visible: (K, p).
        camera: its focal length may be a guess, if it is to be estimated.
        estimate_focal: whether the keyframes may change the focal length.
        known: the rest shape (3, p) so far, of any size.
        start: where a part of the work is done, meanwhile.
        given: a rest shape from elsewhere, which stays. Keyframes of anything but a sheet in perspective add nothing to it.
        kind: what it is, if that is known; its evidence is what keyframes say all the same.
        last: gives more keyframes and their visibility, by which a solid is made, if there will be no other map, so that
            time may be spent on it.
    """
    if len(W) < FEWEST_KEYFRAMES or (given is not None and not camera.perspective):
        return None
    try:
        seen_by = camera if camera.perspective else lens(W, LONG_LENS)
        some, patient = thinned(W.shape[2]), last is not None
        few = W[:, :, some], visible[:, some]
        whole = cache(lambda: sheet(*few, seen_by))
        evidence = select(*few, camera, lambda halves: in_halves(whole(), few[0], halves), start)
        if patient and camera.perspective and evidence.sureness < 1:  # but for its stretch a sheet: bends may be cut off
            fine = cache(lambda: refined(whole(), *few))
            evidence = select(*few, camera, lambda halves: in_halves(fine(), few[0], halves), start)
        evidence, made = evidence.among(some, W.shape[2]), kind or evidence.kind
        if given is not None and made != "sheet":
            return None
        by = W, visible
        if made == "sheet":
            surface = whole() if len(some) == W.shape[2] else sheet(*by, seen_by)
            found = sheet_map(*by, camera, surface, evidence, estimate_focal=estimate_focal, given=given, last=patient)
        else:
            flat = made == "flat"
            by = last() if last and not flat else by
            found = rigid_map(*by, camera, evidence, flat=flat, estimate_focal=estimate_focal, known=known, last=patient)
    except (ReconstructionError, np.linalg.LinAlgError):  # the latter of points that lie as none do
        return None
    f, source = found.camera.focal_px, f"{len(by[0])} keyframes{'' if found.sheet else ' and what is usual'}"
    told = ASSUMED.format(f) if np.isclose(f, camera.focal_px, rtol=1e-9) else f"focal length {f:.0f} px, from {source}"
    return replace(found, seen=by[1], focal_note=told if estimate_focal and camera.perspective else "")


def rigid_map(
    W: Array,
    visible: Mask,
    camera: Camera,
    evidence: Evidence,
    *,
    flat: bool,
    estimate_focal: bool,
    known: Array | None,
    last: bool,
) -> Map:
    """The map of a solid, or of a flat sheet.

    Raises:
        ReconstructionError: too few points, or some are behind the camera; or flat and hardly turned: first frames do.
    """
    found = bundle_adjust(W, visible, camera, refine_focal=estimate_focal, flat=flat, known=None if flat else known)
    if np.isinf(found.energy) or (flat and found.turn_degrees < HARDLY_TURNED):
        raise ReconstructionError(f"not by these keyframes: {found.note}")
    rest = RestShape("plane" if flat else "rigid", found.motion, f"{found.note}; {evidence.note}")
    modes = USUAL_MODES if flat else modes_held(W, visible, found, MOST_MODES if last else MORE_MODES)
    return Map(rest, found.camera, modes=modes, evidence=evidence)


def sheet_map(
    W: Array,
    visible: Mask,
    camera: Camera,
    found: IsometricSheet,
    evidence: Evidence | None,
    *,
    estimate_focal: bool,
    given: RestShape | None = None,
    at: int | None = None,
    last: bool,
) -> Map:
    """The map of a sheet: its rest shape is the one given, or that of a keyframe; else of the one nearest to all others."""
    if camera.perspective:
        found = under_its_focal_length(found) if estimate_focal else found
        camera = found.camera
    rounds = MOST_ROUNDS if last else FEW_ROUNDS
    found = bundled(found, W, rounds)
    for _ in range(AGAIN if found.far else 0):
        found = bundled(likeliest(found), W, rounds)
    if last and camera.perspective and found.stretch > USUAL_STRETCH:
        found = bundled(refined(found, W, visible), W)
    shapes = found.shapes()
    known = np.isfinite(shapes).all(axis=(0, 1))
    middle = medoid(shapes[:, :, known]) if at is None else at
    rest = completed(shapes[middle], shapes[middle])
    rest = rest - rest.mean(axis=1, keepdims=True)
    unit_px = found.camera.focal_px / float(shapes[0, 2, known].mean())
    if given is not None:
        unit_px = ratio_of_sizes(given.motion.shape, rest)
        rest = given.motion.shape / unit_px
    poses = [nearest_rotation((S - S.mean(axis=1, keepdims=True)) @ rest[:, known].T) for S in shapes[:, :, known]]
    middles = [S[:, known].mean(axis=1) for S in shapes]
    origin = np.stack([S - R @ rest[:, known].mean(axis=1) for S, R in zip(middles, poses, strict=True)])
    s = found.camera.focal_px / (unit_px * origin[:, 2])
    t = (s * unit_px)[:, None] * origin[:, :2] + found.camera.center_px - camera.center_px
    motion = RigidMotion(unit_px * rest, np.stack(poses), s, t)
    note = f"{found.note}; {evidence.note}" if evidence else found.note
    # Its shapes hold no noise that more modes would fit; fewer than its functions cut off bends, but are faster on the way.
    note = note if given is None else f"{given.note}; {note}"
    shape = RestShape("isometric" if given is None else given.kind, motion, note)
    return Map(shape, camera, found, unit_px, found.shape_functions if last else MORE_MODES, evidence=evidence)
