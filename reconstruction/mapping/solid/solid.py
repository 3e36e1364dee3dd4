"""A solid's rest shape from view-spread keyframes: robust rigid bundle adjustment, by factorisation or from a dome."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.first.evidence import TURN_DEGREES
from reconstruction.mapping.first.factorization import view_turn_degrees
from reconstruction.mapping.outliers import without_outliers
from reconstruction.mapping.solid.bundle import HALF_WIDTH, Bundle, scaled
from reconstruction.mapping.solid.growth import growth_from
from reconstruction.mapping.solid.placing import FEWEST_POINTS, FEWEST_VIEWS
from reconstruction.mapping.solid.spikes import smoothed
from reconstruction.mapping.solid.views import first_views, likeness, with_unseen

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
        known: a shape (3, p) of any size that it may be: where points are that no view shows; if its far side is hidden, a
            start, too.

    Raises:
        ReconstructionError: fewer than 3 keyframes, or 6 points seen often enough.
    """
    if len(W) < FEWEST_VIEWS or (visible.sum(axis=0) >= FEWEST_VIEWS).sum() < FEWEST_POINTS:
        raise ReconstructionError(f"a solid needs {FEWEST_POINTS} points seen in {FEWEST_VIEWS} keyframes or more")
    given, visible = visible, without_outliers(W, visible)
    W = np.where(given[:, None], W, 0.0) - camera.center_px[:, None]
    alike = likeness(W, visible)
    views = first_views(alike, visible)[: 1 if flat else None]
    first, *others = (growth_from(W, visible, camera, alike, view, flat=flat) for view in views)
    ranked = sorted((one.grown_energy, k) for k, one in enumerate(others))
    likely = [others[k] for value, k in ranked[:SETTLED] if np.isfinite(value)]
    found = [first.best(known, whole=not flat, hidden=bool(likely), refine=refine_focal)]
    found += [one.best(refine=refine_focal) for one in likely]
    grown, best, energy = min(found, key=lambda one: one[2])
    bundle, order = scaled(grown.build.completed(best, grown.some), grown.unit), grown.order
    back = np.argsort(order)
    motion = bundle[back].motion.in_first_frame()
    motion = replace(motion, shape=with_unseen(motion.shape, np.asarray(visible.any(axis=0)), known))
    bundle = Bundle(motion, bundle.kappa)
    return describe(W, given, bundle, camera, flat=flat, energy=energy)


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
