"""A solid's rest shape from view-spread keyframes: robust rigid bundle adjustment, by factorisation or from a dome."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.evidence import TURN_DEGREES
from reconstruction.mapping.factorization import view_turn_degrees
from reconstruction.mapping.outliers import without_outliers
from reconstruction.mapping.solid.adjustment import Adjustment
from reconstruction.mapping.solid.building import Build
from reconstruction.mapping.solid.bundle import HALF_WIDTH, Bundle, scaled
from reconstruction.mapping.solid.placing import FEWEST_POINTS, FEWEST_VIEWS, dome, placed_like, well_spread
from reconstruction.mapping.solid.spikes import smoothed
from reconstruction.mapping.solid.views import Likeness, building_order, completed, first_views, likeness, with_unseen

REPOSINGS, ENOUGH = 5, 0.999  # rounds of posing views anew, while they lower the energy to less than so much of it
SETTLED = 4  # of those that begin elsewhere, the likeliest as grown, are adjusted until nothing changes


@dataclass(frozen=True)
class Solid:
    """A rigid shape that explains keyframes, and how well.

    Attributes:
        motion: shape (3, p) and the K keyframes' poses, in camera axes and pixels of the first keyframe.
        camera: with the focal length that fits best.
        residual_px: (K, p) distance of observation and image, NaN where not visible.
        trusted: (p,) whether the point's depth is its own; else its neighbours gave it.
        turn_degrees: rotation of the viewing direction covered.
        relief: extent off the shape's main plane over that along it, both RMS.
        note: all that in words.
        energy: left over an observation, px²; infinite where nothing rigid lies in front of the camera in all keyframes.
    """

    motion: RigidMotion
    camera: Camera
    residual_px: Array
    trusted: Mask
    turn_degrees: float
    relief: float
    note: str
    energy: float

    @property
    def shape(self) -> Array:
        """(3, p)."""
        return self.motion.shape

    @property
    def frame_residuals_px(self) -> Array:
        """(K,) median residual of each keyframe."""
        return np.asarray(np.nanmedian(self.residual_px, axis=1))


@dataclass(frozen=True)
class Begun:
    """Keyframes in the order in which they are built on from one of them.

    Attributes:
        build: they, in units of what the first shows.
        order: (K,) which they are.
        some: the points that are adjusted together with the poses.
        unit: in px.
    """

    build: Build
    order: Indices
    some: Indices
    unit: float

    @cached_property
    def chosen(self) -> Build:
        """What is adjusted together."""
        return self.build.of(self.some)

    @cached_property
    def grown(self) -> Bundle:
        """Built view by view."""
        build = self.chosen
        return build.grown(dome(build.first, build.kappa, flat=build.flat))

    @property
    def grown_energy(self) -> float:
        """Of that, an observation, px²; infinite where nothing can be built on its first view."""
        try:
            return self.chosen.adjusted(self.grown, Adjustment(steps=0))[1] * self.unit**2
        except np.linalg.LinAlgError:
            return float("inf")

    def best(
        self, known: Array | None = None, *, whole: bool = False, hidden: bool = True, refine: bool
    ) -> tuple["Begun", Bundle, float]:
        """Itself, the likeliest bundle and its energy, px²: grown on a dome or a known shape, or the whole at once.

        Where a solid hides its far side, views that do not fit are posed anew.
        """
        build = self.chosen
        both_ways = build.factorized() if whole else []
        starts = [*both_ways, self.grown]
        starts += [] if known is None else [build.grown(placed_like(build.first, known[:, self.some]))]
        found = [build.settled(one, refine=refine) for one in starts]
        k = int(np.argmin([energy for _, energy in found]))
        best, energy = found[k]
        if build.kappa and k >= len(both_ways):
            other, its_energy = build.settled(best.reversed(), refine=refine)
            best, energy = (other, its_energy) if its_energy < energy else (best, energy)
        for _ in range(REPOSINGS if hidden else 0):
            other, its_energy = build.settled(build.reposed(best), refine=refine)
            if not its_energy < ENOUGH * energy:
                break
            best, energy = other, its_energy
        return self, best, energy * self.unit**2


def bundle_adjust(
    W: Array,
    visible: Mask,
    camera: Camera,
    *,
    refine_focal: bool = True,
    flat: bool = False,
    known: Array | None = None,
) -> Solid:
    """The rigid shape that explains keyframes best.

    Args:
        W: (K, 2, p) px; anything where not visible.
        visible: (K, p).
        camera: its focal length may be a guess.
        refine_focal: whether the views may change it.
        flat: whether the shape is a plane, whatever the views say.
        known: a shape (3, p) of any size that it may be, to start from as well.

    Raises:
        ReconstructionError: fewer than 3 keyframes, or 6 points seen often enough.
    """
    if len(W) < FEWEST_VIEWS or (visible.sum(axis=0) >= FEWEST_VIEWS).sum() < FEWEST_POINTS:
        raise ReconstructionError(f"a solid needs {FEWEST_POINTS} points seen in {FEWEST_VIEWS} keyframes or more")
    given, visible = visible, without_outliers(W, visible)
    W = np.where(given[:, None], W, 0.0) - camera.center_px[:, None]
    alike = likeness(W, visible)
    views = first_views(alike, visible)[: 1 if flat else None]
    first, *others = (begun(W, visible, camera, alike, view, flat=flat) for view in views)
    ranked = sorted((one.grown_energy, k) for k, one in enumerate(others))
    likely = [others[k] for value, k in ranked[:SETTLED] if np.isfinite(value)]
    found = [first.best(known, whole=not flat, hidden=bool(likely), refine=refine_focal)]
    found += [one.best(refine=refine_focal) for one in likely]
    begin, best, energy = min(found, key=lambda one: one[2])
    bundle, order = scaled(begin.build.completed(best, begin.some), begin.unit), begin.order
    back = np.argsort(order)
    motion = bundle[back].motion.in_first_frame()
    motion = replace(motion, shape=with_unseen(motion.shape, np.asarray(visible.any(axis=0)), known))
    bundle = Bundle(motion, bundle.kappa)
    return describe(W, given, bundle, camera, flat=flat, energy=energy)


def begun(W: Array, visible: Mask, camera: Camera, alike: Likeness, view: int, *, flat: bool) -> Begun:
    """Keyframes W (K, 2, p) px, relative to the principal point, with visibility (K, p), from one view on."""
    order, parent = building_order(alike, view)
    first = completed(W, visible, alike, view)
    unit = float(np.sqrt(np.var(first, axis=1).sum()))
    scale = np.abs(alike.a[parent, order])  # of each view against that it is built on
    turn = alike.a[parent, order] / scale
    place, kappa = np.argsort(order)[parent], unit / camera.focal_px
    build = Build(W[order] / unit, visible[order].astype(np.float64), first / unit, turn, scale, place, kappa, flat)
    return Begun(build, order, well_spread(first, visible), unit)


def width(shape: Array) -> float:
    """RMS extent of a shape (3, p) along its main plane, in one coordinate."""
    values = np.linalg.eigvalsh(np.cov(shape, bias=True))
    return float(np.sqrt((values[1] + values[2]) / 2))


def relief(shape: Array) -> float:
    """RMS extent of a shape (3, p) off its main plane over that along it."""
    return float(np.sqrt(np.linalg.eigvalsh(np.cov(shape, bias=True))[0].clip(0))) / width(shape)


def describe(W: Array, visible: Mask, bundle: Bundle, camera: Camera, *, flat: bool, energy: float) -> Solid:
    """The solid of a bundle in pixels, its spikes smoothed; W and bundle relative to the principal point."""
    residual = np.where(visible, np.linalg.norm(bundle.image() - W, axis=1), np.nan)
    focal = 1 / bundle.kappa if bundle.kappa else np.inf
    motion, trusted = smoothed(visible, bundle, residual)
    turn = view_turn_degrees(motion.R)
    depth = relief(motion.shape)
    kind = "flat sheet" if flat else "solid"
    note = f"{kind} from {len(W)} keyframes, turned {turn:.0f}°, median residual {np.nanmedian(residual):.2f} px"
    note += f", relief {depth:.2f} of the width"
    if turn < TURN_DEGREES:
        note += f" (hardly turned: relief beyond {HALF_WIDTH:g} is not believed without proof)"
    return Solid(motion, replace(camera, focal_px=focal), residual, trusted, turn, depth, note, energy)
