"""Rivals of a sheet: a plane and a solid made from some keyframes, and what they leave over on others."""

from dataclasses import dataclass, field

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.solid.placing import FEWEST_VIEWS
from reconstruction.mapping.solid.seen_again import image_in
from reconstruction.mapping.solid.solid import Solid, bundle_adjust
from reconstruction.window.robust import RAYLEIGH_MEDIAN

# A solid that turns less is not proven, unless its relief explains so many times what neighbours share of what it leaves
# over, in squares: what deforms seems to turn, too.
HARDLY_TURNED, EXPLAINED = 25.0, 5.0


@dataclass(frozen=True)
class Misfit:
    """What a hypothesis leaves over on keyframes that it was not made from; deviation in one coordinate.

    Attributes:
        edges_px: of a point against its neighbours.
        whole_px: of a point against the whole; NaN for a sheet, which goes through every point.
    """

    edges_px: float
    whole_px: float


@dataclass(frozen=True)
class Rigid:
    """What a plane and a solid leave over, and the solid's turn and relief.

    Attributes:
        flat, solid: what each leaves over.
        turn_degrees, relief: of the solid.
        shape: (3, p) of the solid, of any size, NaN where too few of its keyframes show a point.
        size_px: usual RMS radius of the images.
    """

    flat: Misfit
    solid: Misfit
    turn_degrees: float
    relief: float
    shape: Array | None = field(default=None, kw_only=True)
    size_px: float = field(default=np.inf, kw_only=True)

    @property
    def proven(self) -> bool:
        """Whether the solid turns so far, or explains so much, that its depth is no guess."""
        left, shared = self.solid.whole_px**2, self.solid.whole_px**2 - self.solid.edges_px**2
        return self.turn_degrees >= HARDLY_TURNED or self.flat.whole_px**2 - left > EXPLAINED * max(shared, 0.0)


def rigid_by(made: tuple[Array, Mask], tested: tuple[Array, Mask], camera: Camera, edges: Indices) -> Rigid:
    """A plane and a solid made from some keyframes, on others that show any of the points."""
    shown = tested[1].any(axis=1)
    tested = tested[0][shown], tested[1][shown]
    solid, flat = (bundle_adjust(*made, camera, refine_focal=False, flat=flat) for flat in (False, True))
    left = [rigid_misfit(model, *tested, camera, edges) for model in (flat, solid)]
    shape = np.where(made[1].sum(axis=0) < FEWEST_VIEWS, np.nan, solid.shape)
    size = float(np.median([np.sqrt(np.var(w[:, seen], axis=1).sum()) for w, seen in zip(*tested, strict=True)]))
    return Rigid(left[0], left[1], solid.turn_degrees, solid.relief, shape=shape, size_px=size)


def rigid_misfit(model: Solid, W: Array, visible: Mask, camera: Camera, edges: Indices) -> Misfit:
    """Of a rigid shape on keyframes that it was not made from."""
    i, j = edges.T
    off = np.where(visible[:, None], image_in(model, W, visible, camera) - W, 0.0)
    seen = visible[:, i] & visible[:, j]
    between = np.median(np.linalg.norm(off[:, :, i] - off[:, :, j], axis=1)[seen]) / RAYLEIGH_MEDIAN / np.sqrt(2)
    return Misfit(float(between), float(np.median(np.linalg.norm(off, axis=1)[visible]) / RAYLEIGH_MEDIAN))


def both(one: Rigid, other: Rigid) -> Rigid:
    """What was found on two halves of the keyframes, together."""
    flat, solid = (
        Misfit(rms([a.edges_px, b.edges_px]), rms([a.whole_px, b.whole_px]))
        for a, b in ((one.flat, other.flat), (one.solid, other.solid))
    )
    turn, relief = (one.turn_degrees + other.turn_degrees) / 2, (one.relief + other.relief) / 2
    return Rigid(flat, solid, turn, relief, shape=one.shape, size_px=one.size_px)


def rms(values: list[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
