"""What the object is, by its keyframes: which kind of thing, its rest shape, its camera, and its shape in any frame."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis import distances
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.model import Model, build_model
from reconstruction.basis.rest_shape import RestShape, RigidMotion, completed
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.one_frame import Foreseen, shape_in
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.keyframes import difference
from reconstruction.mapping.selection import Evidence
from reconstruction.mapping.solid.bundle import seen_by
from reconstruction.mapping.solid.deforming.deformations import Deformations
from reconstruction.settings import USUAL_MODES, Settings
from reconstruction.state import State

FEWEST_POINTS = 20  # that a frame shows, to foresee its shape
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
        return self.rest.flat or self.rest.kind == "isometric" if self.evidence is None else self.rest.kind != "rigid"

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
            if self.sheet is None or (visible & self.sheet.warps.placed).sum() < FEWEST_POINTS:
                found.append(None)
            else:
                last = shape_in(self.sheet, np.where(visible, W, 0.0), visible, last)
                found.append(last)
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
        seen_by = Camera(self.sheet.camera.focal_px, self.camera.center_px)
        if not self.camera.perspective:  # without a distance
            shape = shape + np.array([[0.0], [0.0], [seen_by.focal_px]])
        return model.state_of(shape, seen_by, np.ones(shape.shape[1], np.bool_), None)

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


def nearest_first(found: Map, W: Array, visible: Mask) -> Map:
    """A map with that pose first in which its rest shape looks most like an image (2, p) px, visible (p,)."""
    image = seen_by(found.camera, found.rest.motion)
    every = np.ones((len(image), W.shape[1]), np.bool_)
    order = np.argsort(difference(np.where(visible, W, 0.0), visible, image, every), kind="stable")
    return found.in_order(order)
