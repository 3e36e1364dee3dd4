"""A rigid shape built up from its keyframes: from all at once by factorisation, or from the views most alike onwards."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.mapping.first.factorization import factorize
from reconstruction.mapping.outliers import medians
from reconstruction.mapping.solid.adjustment import Adjustment, adjust
from reconstruction.mapping.solid.bundle import Bundle, Loss, prior_of
from reconstruction.mapping.solid.placing import FEWEST_POINTS, FEWEST_VIEWS, located, placed_by, resection
from reconstruction.window.robust import RAYLEIGH_MEDIAN, deviation

FIRST_VIEWS = 4  # adjusted together first; then twice as many, and so on
SEEN_TWICE = 2  # views in which a point has a depth
TAIL_SIGMAS = 3.0  # of the residuals, where the loss leaves the parabola
OWN_SIGMAS = 5.0  # of a point's own residuals, where its loss does, once the poses are known
LEAST_TAIL = 0.005  # of the size: what tracks of a fine surface are off by anyway
PLACING = Adjustment(steps=5, tolerance=1e-2, points=False)
GROWING = Adjustment(steps=6, tolerance=1e-2)
SETTLING = Adjustment(steps=15, tolerance=1e-3)
PLACING_POINTS = Adjustment(steps=15, tolerance=1e-3, poses=False)
REPOSING = Adjustment(steps=15, tolerance=1e-3, points=False)
REPOSED_SIGMAS, RESECTIONS = 4.0, 5  # of the residuals, beyond which a point is far off; rounds of robust weights
HARDLY, MOSTLY = 0.6, 0.8  # of its views a point must fit, and of its points a view; and times the residual, a better pose
FLAT = 1e5  # weight of a depth off a plane
ROUNDS = 3  # of the noise at the end


@dataclass(frozen=True)
class Build:
    """Keyframes in building order, lengths in units of the shape's RMS radius.

    Attributes:
        W: (K, 2, p) relative to the principal point.
        h: (K, p) visibility.
        first: (2, p) all points in the first.
        turn, scale: (K,) the similarity from the view each is built on: e^(i angle), and scale.
        parent: (K,) index of that view.
        kappa: 1/focal length as given; 0 for an orthographic camera.
        flat: whether the shape is a plane.
    """

    W: Array
    h: Array
    first: Array
    turn: NDArray[np.complex128]
    scale: Array
    parent: Indices
    kappa: float
    flat: bool

    def of(self, points: Indices) -> "Build":
        """The same of some points."""
        return replace(self, W=self.W[:, :, points], h=self.h[:, points], first=self.first[:, points])

    def residual(self, bundle: Bundle) -> Array:
        """Lengths (K, p), NaN where nothing is seen."""
        return np.where(self.h > 0, np.linalg.norm(bundle.image() - self.W, axis=1), np.nan)

    def factorized(self) -> list[Bundle]:
        """From all views at once, as if there were no perspective (Tomasi and Kanade); where there is, either way round.

        Nothing where too little is seen.
        """
        often = (self.h > 0).sum(axis=0) >= FEWEST_VIEWS
        try:
            found = factorize(self.W[:, :, often], self.h[:, often] > 0)
        except (ReconstructionError, np.linalg.LinAlgError):
            return []
        shape = np.zeros((3, len(often)))
        shape[:, often] = found.motion.shape
        bundle = located(self.W, self.h, Bundle(replace(found.motion, shape=shape), self.kappa), ~often, flat=self.flat)
        return [bundle, bundle.reversed()] if self.kappa else [bundle]

    def posed(self, shape: Array) -> Bundle:
        """A shape (3, p) of any size, turned anyhow, where each view shows it, by robust affine resection."""
        shape = shape - shape.mean(axis=1, keepdims=True)
        R, s, t = self._resected(shape, 0, self.h[0] > 0)
        start = RigidMotion(s * R @ shape, np.eye(3)[None], np.ones(1), t[None])
        m = self.with_views(Bundle(start, self.kappa), len(self.W)).motion
        for k in (1 + np.flatnonzero((self.h[1:] > 0).sum(axis=1) >= FEWEST_POINTS)).tolist():
            m.R[k], m.s[k], m.t[k] = self._resected(m.shape, k, self.h[k] > 0)
        return self.adjusted(Bundle(m, self.kappa), REPOSING)[0]

    def grown(self, start: RigidMotion) -> Bundle:
        """First the views most alike, then more and more, each placed by points that have been seen twice before it."""
        bundle = Bundle(start, self.kappa)
        count, total = 1, len(self.W)
        while count < total:
            more = min(max(FIRST_VIEWS, 2 * count), total)
            known = (self.h[:count] > 0).sum(axis=0) >= min(SEEN_TWICE, count)
            placing = self._by(known, count)
            bundle, _ = placing.adjusted(placing.with_views(bundle, more), PLACING)
            bundle = located(self.W[:more], self.h[:more], bundle, ~known, flat=self.flat)
            bundle, _ = self.adjusted(bundle, GROWING)
            count = more
        return bundle

    def settled(self, bundle: Bundle, *, refine: bool) -> tuple[Bundle, float]:
        """All at once until nothing changes, and its energy an observation; `refine`: the focal length, too."""
        bundle, value = self.adjusted(bundle, SETTLING)
        for _ in range(ROUNDS):
            bundle, value = self.adjusted(bundle, SETTLING, refine=refine, redescending=True)
        return bundle, value

    def reposed(self, bundle: Bundle) -> Bundle:
        """Views in which many points are far off posed anew, by those that are not elsewhere, where that fits better.

        A view that was placed by few points may be stuck, and no step of all of them mends it.
        """
        m, seen = bundle.motion, self.h > 0
        residual = self.residual(bundle)
        near = residual < REPOSED_SIGMAS * deviation(residual[seen], LEAST_TAIL / TAIL_SIGMAS)
        sound = near.sum(axis=0) > HARDLY * seen.sum(axis=0)
        R, s, t = m.R.copy(), m.s.copy(), m.t.copy()
        for k in np.flatnonzero(near.sum(axis=1) < MOSTLY * seen.sum(axis=1)).tolist():
            use = seen[k] & sound
            if use.sum() >= FEWEST_POINTS:
                R[k], s[k], t[k] = self._resected(m.shape, k, use)
        other, _ = self.adjusted(Bundle(RigidMotion(m.shape, R, s, t), bundle.kappa), REPOSING)
        better = medians(self.residual(other), axis=1) < MOSTLY * medians(residual, axis=1)
        R, s, t = (
            np.where(better.reshape(-1, *[1] * (new.ndim - 1)), new, old)
            for new, old in ((other.motion.R, m.R), (other.motion.s, m.s), (other.motion.t, m.t))
        )
        return Bundle(RigidMotion(m.shape, R, s, t), bundle.kappa)

    def _resected(self, shape: Array, k: int, use: Mask) -> tuple[Array, float, Array]:
        """Rotation (3, 3), scale and shift (2,) with which points `use` (p,) of a shape (3, p) look most like a view."""
        X, u = shape[:, use], self.W[k][:, use]
        R, s = resection(X, u, RESECTIONS)
        Y = s * R @ X
        return R, s, np.median(u * (1 + self.kappa * Y[2]) - Y[:2], axis=1)

    def completed(self, bundle: Bundle, points: Indices) -> Bundle:
        """A bundle of some points with all of them where its poses place them, each as well as it moves with the others.

        What agrees best gives the poses; a mouth that opens and shuts would be where it is most often, not in between.
        """
        shape = placed_by(self.W, self.h, bundle, flat=self.flat)
        shape[:, points] = bundle.motion.shape
        bundle = Bundle(replace(bundle.motion, shape=shape), bundle.kappa)
        for _ in range(ROUNDS):
            residual = self.residual(bundle)
            sigma = deviation(residual[self.h > 0], LEAST_TAIL / TAIL_SIGMAS)
            own = np.nan_to_num(medians(residual, axis=0)) / RAYLEIGH_MEDIAN
            scale = TAIL_SIGMAS * sigma if self.flat else OWN_SIGMAS * own.clip(sigma)  # nothing of a plane is livelier
            bundle, _ = self._minimised(bundle, Loss(scale, True), sigma, PLACING_POINTS)
        return located(self.W, self.h, bundle, (self.h > 0).sum(axis=0) < SEEN_TWICE, flat=self.flat)

    def with_views(self, bundle: Bundle, count: int) -> Bundle:
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
            shown = self.h[k] > 0
            t.append(np.median(off[:, shown], axis=1) if shown.any() else s[k] / s[parent] * t[parent])
        return Bundle(RigidMotion(m.shape, np.array(R), np.array(s), np.array(t)), bundle.kappa)

    def adjusted(
        self, bundle: Bundle, how: Adjustment, *, refine: bool = False, redescending: bool = False
    ) -> tuple[Bundle, float]:
        """Adjusted with a loss and priors scaled to the residuals, and its energy an observation."""
        n = len(bundle.motion.s)
        off = np.linalg.norm(bundle.image() - self.W[:n], axis=1)[self.h[:n] > 0]
        sigma = deviation(off, LEAST_TAIL / TAIL_SIGMAS)
        return self._minimised(bundle, Loss(TAIL_SIGMAS * sigma, redescending), sigma, how, refine=refine)

    def _by(self, known: Mask, count: int) -> "Build":
        """The same with views from `count` on showing points (p,) that are known alone, those that show enough of them."""
        h = self.h.copy()
        enough = count + np.flatnonzero((h[count:, known] > 0).sum(axis=1) >= FEWEST_POINTS)
        h[np.ix_(enough, ~known)] = 0.0
        return replace(self, h=h)

    def _minimised(
        self, bundle: Bundle, loss: Loss, sigma: float, how: Adjustment, *, refine: bool = False
    ) -> tuple[Bundle, float]:
        """Adjusted with a loss, and priors scaled to residuals of that deviation."""
        n = len(bundle.motion.s)
        W, h = self.W[:n], self.h[:n]
        prior = prior_of(bundle, h, sigma, self.kappa, refine=refine)
        prior = replace(prior, depth=FLAT) if self.flat else prior
        bundle, value = adjust(W, h, bundle, loss, prior, how)
        return bundle.centred(), value / h.sum()
