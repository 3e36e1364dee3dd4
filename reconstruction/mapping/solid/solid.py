"""A solid's rest shape from view-spread keyframes: robust rigid bundle adjustment from shallow domes."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.evidence import TURN_DEGREES
from reconstruction.mapping.factorization import view_turn_degrees
from reconstruction.mapping.outliers import medians, without_outliers
from reconstruction.mapping.solid.adjustment import Adjustment, adjust
from reconstruction.mapping.solid.bundle import HALF_WIDTH, Bundle, Loss, prior_of, scaled
from reconstruction.mapping.solid.placing import FEWEST_POINTS, FEWEST_VIEWS, dome, placed_by, placed_like, well_spread
from reconstruction.mapping.solid.spikes import smoothed
from reconstruction.mapping.solid.views import building_order, completed, likeness, with_unseen
from reconstruction.window.robust import RAYLEIGH_MEDIAN, deviation

FIRST_VIEWS = 4  # adjusted together first; then twice as many, and so on
TAIL_SIGMAS = 3.0  # of the residuals, where the loss leaves the parabola
OWN_SIGMAS = 5.0  # of a point's own residuals, where its loss does, once the poses are known
LEAST_TAIL = 0.005  # of the size: what tracks of a fine surface are off by anyway
PLACING = Adjustment(steps=5, tolerance=1e-2, points=False)
GROWING = Adjustment(steps=6, tolerance=1e-2)
SETTLING = Adjustment(steps=15, tolerance=1e-3)
PLACING_POINTS = Adjustment(steps=15, tolerance=1e-3, poses=False)
FLAT = 1e5  # weight of a depth off a plane
FLAT_DOME = 1e-3
ROUNDS = 3  # of the noise at the end


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
        bulges: robust energies of the two starts per observation, the better first.
        note: all that in words.
    """

    motion: RigidMotion
    camera: Camera
    residual_px: Array
    trusted: Mask
    turn_degrees: float
    relief: float
    bulges: tuple[float, float]
    note: str

    @property
    def shape(self) -> Array:
        """(3, p)."""
        return self.motion.shape

    @property
    def frame_residuals_px(self) -> Array:
        """(K,) median residual of each keyframe."""
        return np.asarray(np.nanmedian(self.residual_px, axis=1))


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
    order, parent = building_order(alike)
    first = completed(W, visible, alike, order[0])
    unit = float(np.sqrt(np.var(first, axis=1).sum()))
    turn = alike.a[parent, order] / np.abs(alike.a[parent, order])  # of each view against that it is built on
    place = np.argsort(order)[parent]
    kappa = unit / camera.focal_px
    scale = np.abs(alike.a[parent, order])
    whole = Build(W[order] / unit, visible[order].astype(np.float64), first / unit, turn, scale, place, flat)
    some = well_spread(first, visible)
    build = whole.of(some)
    domes = [dome(build.first, FLAT_DOME * bulge if flat else bulge, kappa) for bulge in ((1, -1) if kappa else (1,))]
    starts = domes if known is None else [*domes, placed_like(build.first, known[:, some])]
    found = sorted((build.run(start, kappa, refine=refine_focal) for start in starts), key=lambda one: one[1])
    if kappa:
        found = sorted([*found, build.reversed(found[0][0], kappa, refine=refine_focal)], key=lambda one: one[1])
    bundle = scaled(whole.completed(found[0][0], some), unit)
    back = np.argsort(order)
    motion = bundle[back].motion.in_first_frame()
    motion = replace(motion, shape=with_unseen(motion.shape, np.asarray(visible.any(axis=0)), known))
    bundle = Bundle(motion, bundle.kappa)
    return describe(W, given, bundle, camera, (found[0][1], found[1][1] if kappa else found[0][1]))


@dataclass(frozen=True)
class Build:
    """Keyframes in building order, lengths in units of the shape's RMS radius.

    Attributes:
        W: (K, 2, p) relative to the principal point.
        h: (K, p) visibility.
        first: (2, p) all points in the first.
        turn, scale: (K,) the similarity from the view each is built on: e^(i angle), and scale.
        parent: (K,) index of that view.
        flat: whether the shape is a plane.
    """

    W: Array
    h: Array
    first: Array
    turn: NDArray[np.complex128]
    scale: Array
    parent: Indices
    flat: bool

    def run(self, start: RigidMotion, kappa: float, *, refine: bool) -> tuple[Bundle, float]:
        """First the views most alike, then more and more; the bundle and its energy an observation."""
        bundle = Bundle(start, kappa)
        count, total = 1, len(self.W)
        while count < total:
            more = min(max(FIRST_VIEWS, 2 * count), total)
            bundle, count = self._with_views(bundle, more), more
            bundle, _ = self._adjust(bundle, kappa, PLACING)
            bundle, _ = self._adjust(bundle, kappa, GROWING)
        return self._settled(bundle, kappa, refine=refine)

    def reversed(self, bundle: Bundle, kappa: float, *, refine: bool) -> tuple[Bundle, float]:
        """From a bundle with its depth reversed, which explains distant views as well."""
        return self._settled(Bundle(bundle.motion.mirrored(), kappa), kappa, refine=refine)

    def of(self, points: Indices) -> "Build":
        """The same of some points."""
        return replace(self, W=self.W[:, :, points], h=self.h[:, points], first=self.first[:, points])

    def completed(self, bundle: Bundle, points: Indices) -> Bundle:
        """A bundle of some points with all of them where its poses place them, each as well as it moves with the others.

        What agrees best gives the poses; a mouth that opens and shuts would be where it is most often, not in between.
        """
        shape = placed_by(self.W, self.h, bundle)
        shape[:, points] = bundle.motion.shape
        bundle = Bundle(replace(bundle.motion, shape=shape), bundle.kappa)
        for _ in range(ROUNDS):
            residual = np.where(self.h > 0, np.linalg.norm(bundle.image() - self.W, axis=1), np.nan)
            sigma = deviation(residual[self.h > 0], LEAST_TAIL / TAIL_SIGMAS)
            own = np.nan_to_num(medians(residual, axis=0)) / RAYLEIGH_MEDIAN
            scale = TAIL_SIGMAS * sigma if self.flat else OWN_SIGMAS * own.clip(sigma)  # nothing of a plane is livelier
            bundle, _ = self._minimised(bundle, Loss(scale, True), sigma, bundle.kappa, PLACING_POINTS)
        return bundle

    def _settled(self, bundle: Bundle, kappa: float, *, refine: bool) -> tuple[Bundle, float]:
        bundle, value = self._adjust(bundle, kappa, SETTLING)
        for _ in range(ROUNDS):
            bundle, value = self._adjust(bundle, kappa, SETTLING, refine=refine, redescending=True)
        return bundle, value

    def _with_views(self, bundle: Bundle, count: int) -> Bundle:
        """The first `count` views, new ones posed as the view they are built on."""
        m = bundle.motion
        R, s, t = list(m.R), list(m.s), list(m.t)
        for k in range(len(s), count):
            parent, angle = self.parent[k], self.turn[k]
            Rz = np.array([[angle.real, -angle.imag, 0.0], [angle.imag, angle.real, 0.0], [0.0, 0.0, 1.0]])
            R.append(Rz @ R[parent])
            s.append(s[parent] * self.scale[k])
            seen = s[k] * R[k] @ m.shape
            off = self.W[k] * (1 + bundle.kappa * seen[2]) - seen[:2]
            t.append(np.median(off[:, self.h[k] > 0], axis=1))
        return Bundle(RigidMotion(m.shape, np.array(R), np.array(s), np.array(t)), bundle.kappa)

    def _adjust(
        self, bundle: Bundle, kappa: float, how: Adjustment, *, refine: bool = False, redescending: bool = False
    ) -> tuple[Bundle, float]:
        """Adjust with a loss and priors scaled to the residuals."""
        n = len(bundle.motion.s)
        W, h = self.W[:n], self.h[:n]
        sigma = deviation(np.linalg.norm(bundle.image() - W, axis=1)[h > 0], LEAST_TAIL / TAIL_SIGMAS)
        return self._minimised(bundle, Loss(TAIL_SIGMAS * sigma, redescending), sigma, kappa, how, refine=refine)

    def _minimised(
        self, bundle: Bundle, loss: Loss, sigma: float, kappa: float, how: Adjustment, *, refine: bool = False
    ) -> tuple[Bundle, float]:
        """Adjust with a loss, and priors scaled to residuals of that deviation."""
        n = len(bundle.motion.s)
        W, h = self.W[:n], self.h[:n]
        prior = prior_of(bundle, h, sigma, kappa, refine=refine)
        prior = replace(prior, depth=FLAT) if self.flat else prior
        bundle, value = adjust(W, h, bundle, loss, prior, how)
        return bundle.centred(), value / h.sum()


def width(shape: Array) -> float:
    """RMS extent of a shape (3, p) along its main plane, in one coordinate."""
    values = np.linalg.eigvalsh(np.cov(shape, bias=True))
    return float(np.sqrt((values[1] + values[2]) / 2))


def relief(shape: Array) -> float:
    """RMS extent of a shape (3, p) off its main plane over that along it."""
    return float(np.sqrt(np.linalg.eigvalsh(np.cov(shape, bias=True))[0].clip(0))) / width(shape)


def describe(W: Array, visible: Mask, bundle: Bundle, camera: Camera, bulges: tuple[float, float]) -> Solid:
    """The solid of a bundle in pixels, its spikes smoothed; W and bundle relative to the principal point."""
    residual = np.where(visible, np.linalg.norm(bundle.image() - W, axis=1), np.nan)
    focal = 1 / bundle.kappa if bundle.kappa else np.inf
    motion, trusted = smoothed(visible, bundle, residual)
    turn = view_turn_degrees(motion.R)
    depth = relief(motion.shape)
    note = f"solid from {len(W)} keyframes, turned {turn:.0f}°, median residual {np.nanmedian(residual):.2f} px"
    note += f", relief {depth:.2f} of the width"
    if turn < TURN_DEGREES:
        note += f" (hardly turned: relief beyond {HALF_WIDTH:g} is not believed without proof)"
    return Solid(motion, replace(camera, focal_px=focal), residual, trusted, turn, depth, bulges, note)
