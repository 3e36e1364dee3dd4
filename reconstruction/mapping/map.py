"""What the object is, by its keyframes: which kind of thing, its rest shape, its camera, and its shape in any frame."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis import distances
from reconstruction.basis.mesh import Mesh, ratio_of_sizes
from reconstruction.basis.model import Model, build_model
from reconstruction.basis.rest_shape import RestShape, RigidMotion, completed, medoid
from reconstruction.camera import Camera, lens, nearest_rotation
from reconstruction.mapping.isometric.adjustment import FEW_ROUNDS, MOST_ROUNDS, bundled, in_halves, refined, sheet
from reconstruction.mapping.isometric.focal import under_its_focal_length
from reconstruction.mapping.isometric.one_frame import Foreseen, shape_in
from reconstruction.mapping.isometric.sheet import USUAL_STRETCH, IsometricSheet
from reconstruction.mapping.selection import Evidence, Kind, select
from reconstruction.mapping.solid.deforming.deformations import Deformations
from reconstruction.mapping.solid.deforming.freedom import modes_held
from reconstruction.mapping.solid.rivals import HARDLY_TURNED
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.mapping.start import Start, at_once
from reconstruction.settings import MORE_MODES, MOST_MODES, USUAL_MODES, Settings
from reconstruction.state import State

FEWEST_KEYFRAMES, FEWEST_POINTS = 6, 20
LONG_LENS = 40.0  # focal length over the object's size, RMS, of a lens that sees as an orthographic camera does
ASSUMED = "focal length {:.0f} px assumed: give it if you know better"


@dataclass(frozen=True)
class Map:
    """What an object is.

    Attributes:
        rest: the rest shape, posed in each keyframe; pixels of the first keyframe.
        camera: with the focal length that the keyframes hold, else as given.
        sheet: its depths and lengths, if it is a sheet.
        unit_px: pixels of the first keyframe in a unit of the sheet.
        modes: how many it is worth.
        focal_note: how the focal length was found, in words; empty if it was not looked for.
        evidence: what keyframes say for it, half against half; None before there are enough of them.
        seen: (K, p) what the keyframes show; None where it is not by keyframes.
        model: the rest shape with its modes, once they are made.
        deformations: what is known of Λ' beforehand, of that model.
    """

    rest: RestShape
    camera: Camera
    sheet: IsometricSheet | None = None
    unit_px: float = 1.0
    modes: int = USUAL_MODES
    focal_note: str = ""
    evidence: Evidence | None = None
    seen: Mask | None = None
    model: Model | None = None
    deformations: Deformations | None = None

    @property
    def is_sheet(self) -> bool:
        """Whether it is bent, not turned: a plane or a sheet; by its relief where no keyframes say."""
        return self.rest.flat if self.evidence is None else self.rest.kind != "rigid"

    def modelled(self, settings: Settings, mesh: Mesh | None = None, own_motion: Array | None = None) -> Model:
        """The rest shape with its modes; its mesh may be given, and how its points move (d, p), as for `modal_basis`.

        Raises:
            ReconstructionError: more modes are asked for than the points carry.
        """
        metric = distances.fitting(settings.metric, flat=self.is_sheet)
        most = self.rest.motion.shape.shape[1] - 1
        modes = min(self.modes, most) if settings.modes == "auto" else settings.modes
        return build_model(self.rest, self.camera, modes, metric, mesh, self.seen, own_motion)

    def foreseen(self, frames: list[tuple[Array, Mask]], last: Foreseen | None = None) -> list[Foreseen | None]:
        """What `expected` finds in frames, one after the other, points (2, p) px, anything where not visible (p,).

        None for a solid, or with too few points. `last` is what was found in the frame before.
        """
        found: list[Foreseen | None] = []
        for W, visible in frames:
            few = self.sheet is None or visible.sum() < FEWEST_POINTS
            one = None if self.sheet is None or few else shape_in(self.sheet, np.where(visible, W, 0.0), visible, last)
            last = one or last
            found.append(one)
        return found

    def expected(self, model: Model, foreseen: Foreseen | None, last: State | None) -> State | None:
        """Pose and Λ' of a sheet in another frame, by its lengths; None where nothing is foreseen.

        Args:
            model: the modes of the rest shape.
            foreseen: in that frame.
            last: the frame before, if there is one: what does not show stays, and orthographic depth keeps its sign.
        """
        if self.sheet is None or foreseen is None:
            return None
        shape = self.unit_px * completed(foreseen.shape, self.rest.motion.shape)
        if last is not None and not self.camera.perspective:
            depth, before = shape[2] - shape[2].mean(), (last.matrices()[-1] @ model.B)[2]
            if depth @ (before - before.mean()) < 0:
                shape[2] -= 2 * depth
        return model.state_of(shape, self.sheet.camera, self.sheet.warps.placed, last)

    def state_of(self, model: Model, shape: Array) -> State | None:
        """Pose and Λ' of a shape (3, p) in camera axes, px, by the modes of a sheet; None for a solid."""
        if self.sheet is None:
            return None
        return model.state_of(shape, self.sheet.camera, np.ones(shape.shape[1], np.bool_), None)

    def turned_like(self, shape: Array) -> "Map":
        """The same or its mirror image, whichever is deep where a shape (3, p) is: seen without perspective, both fit."""
        motion = self.rest.motion
        if (motion.R[0] @ motion.shape)[2] @ (shape[2] - shape[2].mean()) >= 0:
            return self
        model = self.model and self.model.mirrored()
        known = self.deformations and self.deformations.mirrored()
        return replace(self, rest=replace(self.rest, motion=motion.mirrored()), model=model, deformations=known)

    def in_order(self, order: Indices) -> "Map":
        """The same, its poses in another order: the first is that of the frame where it begins."""
        motion = self.rest.motion.in_order(order)
        seen = None if self.seen is None else self.seen[order]
        model = self.model and self.model.begun(motion)
        return replace(self, rest=replace(self.rest, motion=motion), seen=seen, model=model)

    def scaled(self, factor: float) -> "Map":
        """The same, so many times as large, and so many times as far away."""
        motion = self.rest.motion
        motion = RigidMotion(factor * motion.shape, motion.R, motion.s / factor, motion.t)
        model = self.model and self.model.scaled(factor)
        return replace(self, rest=replace(self.rest, motion=motion), unit_px=factor * self.unit_px, model=model)


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
        W: anything where not visible.
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
        whole, patient = cache(lambda: sheet(W, visible, seen_by)), last is not None
        evidence = select(W, visible, camera, lambda halves: in_halves(whole(), W, halves), start)
        if patient and camera.perspective and evidence.sureness < 1:  # but for its stretch a sheet: bends may be cut off
            fine = cache(lambda: refined(whole(), W, visible))
            evidence = select(W, visible, camera, lambda halves: in_halves(fine(), W, halves), start)
        made = kind or evidence.kind
        if given is not None and made != "sheet":
            return None
        by = W, visible
        if made == "sheet":
            found = sheet_map(*by, camera, whole(), evidence, estimate_focal=estimate_focal, given=given, last=patient)
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
    evidence: Evidence,
    *,
    estimate_focal: bool,
    given: RestShape | None = None,
    last: bool,
) -> Map:
    """The map of a sheet: its rest shape is the one given, else the keyframe's shape that is nearest to all others."""
    if camera.perspective:
        found = under_its_focal_length(found) if estimate_focal else found
        camera = found.camera
    found = bundled(found, W, MOST_ROUNDS if last else FEW_ROUNDS)
    if last and camera.perspective and found.stretch > USUAL_STRETCH:
        found = bundled(refined(found, W, visible), W)
    shapes = found.shapes()
    known = np.isfinite(shapes).all(axis=(0, 1))
    middle = medoid(shapes[:, :, known])
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
    note = f"{found.note}; {evidence.note}"
    # Its shapes hold no noise that more modes would fit; fewer than its functions cut off bends, but are faster on the way.
    note = note if given is None else f"{given.note}; {note}"
    shape = RestShape("isometric" if given is None else given.kind, motion, note)
    return Map(shape, camera, found, unit_px, found.shape_functions if last else MORE_MODES, evidence=evidence)
