"""Robust smooth maps between the images of a bending sheet: tracks without noise, gross errors and gaps."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.mapping.isometric.smooth_field import SmoothField, smooth_field
from reconstruction.mapping.outliers import without_outliers

FUNCTIONS = 100  # of the field that an image is made of
ROUGH_FUNCTIONS = 20  # of the one that only says where a point would be in the reference image
NODES = 200
ROUGH_NODES = 50
ROUGH_SWEEPS = 4  # of re-weighting, with few functions and few points
SWEEPS = 3  # more with all functions, the last with all points
FEW = 250  # well-spread points that are enough to tell gross errors
FEW_FUNCTIONS = 40  # where bending is held firmly
ENOUGH = 0.8  # of them that must be seen
FULL = 0.9  # of the points of the image that shows most: as good as all
TRIED = 8  # images by which the weight of bending is found
FIRM = 10.0 ** np.arange(-7, 1.5, 0.5)  # weights of bending that are tried
GROSS = 8.0  # times the usual residual: not the same point
FIRST_FIRMNESS = 1e-5
FINEST = 1e-4  # of the image's RMS radius: no residual is usually smaller


@dataclass(frozen=True)
class Warps:
    """F images of p points as smooth functions of where the points are in a reference image.

    Attributes:
        field: the functions, over the reference image.
        reference: (2, p) the points there, px; NaN where a point was not seen often enough.
        values: (p, r) of the functions at all points, 0 where a point has no place.
        few: well-spread points among those placed.
        placed: (p,) the points that any image shows.
        coefficients: (F, r, 2) of each image, px.
        weights: (F, p) of the observations, 0 where there is none.
        inlier: (F, p) observations that fit.
        noise_px: (F,) usual distance of an observation from its smooth image: standard deviation of a coordinate.
        firmness: weight of bending, found by generalised cross validation.
    """

    field: SmoothField
    reference: Array
    values: Array
    few: Indices
    placed: Mask
    coefficients: Array
    weights: Array
    inlier: Mask
    noise_px: Array
    firmness: float

    def images(self, points: Mask | Indices | slice = slice(None)) -> Array:
        """Where points are in all images, (F, 2, n) px."""
        return np.asarray((self.values[points] @ self.coefficients).transpose(0, 2, 1))

    def variance(self, points: Mask | Indices | slice = slice(None)) -> Array:
        """Variance (F, n) px² of a coordinate of those: small among visible points, large far from any."""
        at = self.values[points]
        held = np.diag(self.firmness * self.field.stiffness + 1e-12)
        out = []
        for h, sigma in zip(self.weights, self.noise_px, strict=True):
            rows = spread_rows(h > 0, self.few)
            B, hs = self.values[rows], h[rows]
            inverse = np.linalg.inv((B.T * hs) @ B / hs.sum() + held) / h.sum()
            out.append(sigma**2 * ((at @ inverse) * at).sum(axis=1))
        return np.array(out)

    def in_frames(self, chosen: Indices) -> "Warps":
        """Some of the images."""
        return replace(
            self,
            coefficients=self.coefficients[chosen],
            weights=self.weights[chosen],
            inlier=self.inlier[chosen],
            noise_px=self.noise_px[chosen],
        )

    def moved(self, places: Array) -> "Warps":
        """The same functions, points with other places (2, p) on the reference image."""
        values = np.zeros_like(self.values)
        values[self.placed] = self.field.at(places[:, self.placed])
        return replace(self, reference=places, values=values)


def smooth_warps(W: Array, visible: Mask) -> Warps:
    """Smooth images of W (F, 2, p) px, by visibility (F, p)."""
    F, _, p = W.shape
    reference = reference_image(W, without_outliers(W, visible))  # one where few are seen would bend the map to it
    placed: Mask = np.isfinite(reference[0])
    few = np.flatnonzero(placed)[farthest_points(reference[:, placed].T, FEW)]
    field = smooth_field(reference[:, few[:NODES]], FUNCTIONS)
    values = np.zeros((p, len(field.stiffness)))
    values[placed] = field.at(reference[:, placed])
    nothing = np.zeros((F, p))
    empty = Warps(
        field, reference, values, few, placed, np.zeros((F, 0, 2)), nothing, nothing > 0, np.ones(F), FIRST_FIRMNESS
    )
    return fitted(empty, W, visible, found_firmness(empty, W, visible))


def found_firmness(warps: Warps, W: Array, visible: Mask) -> float:
    """Weight of bending that suits images W (F, 2, p) px: by some of them, and by some of the points."""
    some, firmness = np.unique(np.linspace(0, len(W) - 1, TRIED).astype(int)), FIRST_FIRMNESS
    few = replace(warps, values=warps.values[warps.few], few=np.arange(len(warps.few)), placed=warps.placed[warps.few])
    W, visible = W[some][:, :, warps.few], visible[some][:, warps.few]
    for _ in range(2):
        firmness = cross_validated(few.values, W, fitted(few, W, visible, firmness).weights, few.field.stiffness)
    return firmness


def fitted(warps: Warps, W: Array, visible: Mask, firmness: float) -> Warps:
    """Images W (F, 2, p) px made smooth with the functions of other warps."""
    pairs = zip(W, visible & warps.placed, strict=True)
    fits = [robust_fit(warps.values, w, h, warps.field.stiffness, firmness, warps.few) for w, h in pairs]
    coefficients, weights, inlier, noise = (np.stack(parts) for parts in zip(*fits, strict=True))
    return replace(warps, coefficients=coefficients, weights=weights, inlier=inlier, noise_px=noise, firmness=firmness)


def reference_image(W: Array, visible: Mask) -> Array:
    """One image (2, p) px of all points: the median of what every image, warped on to the clearest one, says.

    NaN for points that no image shows.
    """
    clearest = clearest_image(W, visible)
    said = np.full((len(W), 2, W.shape[2]), np.nan)
    for f, (w, h) in enumerate(zip(W, visible, strict=True)):
        both = np.flatnonzero(h & visible[clearest])
        if f == clearest or len(both) < 2 * ROUGH_FUNCTIONS:
            said[f][:, h] = w[:, h] if f == clearest else np.nan
            continue
        nodes = both[farthest_points(w[:, both].T, ROUGH_NODES)]
        field = smooth_field(w[:, nodes], ROUGH_FUNCTIONS)
        B = field.at(w[:, h])
        target = W[clearest][:, h]
        c = robust_fit(B, target, visible[clearest][h], field.stiffness, 1e-3)[0]
        said[f][:, h] = (B @ c).T
    return median(said)


def clearest_image(W: Array, visible: Mask) -> int:
    """Of the images that show most points, the one in which they lie farthest from each other.

    What is seen there from the side or folded over is no function of it in any other image.
    """
    count = visible.sum(axis=1)
    full = np.flatnonzero(count >= FULL * count.max())
    fullest = int(count.argmax())
    few = np.flatnonzero(visible[fullest])
    few = few[farthest_points(W[fullest][:, few].T, FEW)]
    apart = []
    for f in full:
        place = W[f][:, few[visible[f, few]]].T
        nearest = cKDTree(place).query(place, k=2)[0][:, 1]
        apart.append(np.log(nearest.clip(1e-12)).mean())
    return int(full[np.argmax(apart)])


def spread_rows(seen: Mask, few: Indices) -> Indices:
    """Well-spread points among those seen (p,): of the few if there are enough of them, else all."""
    rows = few[seen[few]]
    return rows if len(rows) > ENOUGH * len(few) else np.flatnonzero(seen)


def robust_fit(
    B: Array, w: Array, seen: Mask, stiffness: Array, firmness: float, few: Indices | None = None
) -> tuple[Array, Array, Mask, float]:
    """Smooth function through image points w (2, p), Geman-McClure weights, B (p, r) the functions at the points.

    Gross errors must not bend it: it is stiff at first, and made of the first functions and of the few points only.

    Returns:
        coefficients (r, 2), weights (p,), inliers (p,), usual residual of a coordinate.
    """
    every = np.flatnonzero(seen)
    some = every if few is None else spread_rows(seen, few)
    finest = FINEST * float(np.sqrt(np.var(w[:, some], axis=1).sum()))
    h, done, c = np.ones(len(some)), 0, np.zeros((0, 2))
    for rows, r, sweeps in (
        (some, FEW_FUNCTIONS, ROUGH_SWEEPS),
        (some, len(stiffness), SWEEPS - 1),
        (every, len(stiffness), 1),
    ):
        Bs, ws = B[rows, :r], w[:, rows].T
        if done:
            h = weights_of(ws - Bs[:, : len(c)] @ c, finest)[0]
        for _ in range(sweeps):
            done += 1
            firm = max(firmness, 10.0**-done)
            c, _ = weighted_fit(Bs, ws, h, firm * stiffness[:r])
            h, off, usual = weights_of(ws - Bs @ c, finest)
    weights, inlier = np.zeros(len(B)), np.zeros(len(B), bool)
    weights[every], inlier[every] = h, off < GROSS * usual
    return c, weights, inlier, usual


def quick_fit(warps: Warps, w: Array, visible: Mask, points: Indices) -> tuple[Array, Array, Array]:
    """One more image w (2, p) px made smooth: as `robust_fit` does, but by the few points only.

    Returns:
        (2, p) px of all points, variance (n,) px² of a coordinate of some of them, weights (p,) px⁻² of the observations.
    """
    B, stiffness, every = warps.values, warps.field.stiffness, np.flatnonzero(visible & warps.placed)
    some = spread_rows(visible & warps.placed, warps.few)
    few, target, h = B[some], w[:, some].T, np.ones(len(some))
    finest = FINEST * float(np.sqrt(np.var(target, axis=0).sum()))
    rough = few[:, :FEW_FUNCTIONS]
    for sweep in range(ROUGH_SWEEPS):
        c, _ = weighted_fit(rough, target, h, 0.1 ** (sweep + 1) * stiffness[:FEW_FUNCTIONS])
        h, _, _ = weights_of(target - rough @ c, finest)
    c, gram = weighted_fit(few, target, h, warps.firmness * stiffness)
    image, weights = B @ c, np.zeros(len(B))
    h, _, usual = weights_of(w[:, every].T - image[every], finest)
    weights[every] = h / usual**2
    at = B[points]
    return image.T, usual**2 / h.sum() * ((at @ np.linalg.inv(gram)) * at).sum(axis=1), weights


def weighted_fit(B: Array, target: Array, h: Array, held: Array) -> tuple[Array, Array]:
    """Coefficients (r, 2) of functions B (n, r) through a target (n, 2) weighted by h, held back; and the normal matrix."""
    weighted = B.T * (h / h.sum())
    gram = weighted @ B
    gram[np.diag_indices(len(gram))] += held + 1e-12
    return np.linalg.solve(gram, weighted @ target), gram


def weights_of(residual: Array, finest: float) -> tuple[Array, Array, float]:
    """Geman-McClure weights (n,) of residuals (n, 2), their lengths (n,), and the usual residual of a coordinate."""
    off = np.sqrt((residual**2).sum(axis=1))
    usual = max(float(np.partition(off, len(off) // 2)[len(off) // 2]) / 1.1774, finest)  # of a Rayleigh distribution
    return 1 / (1 + (off / (GROSS * usual)) ** 2) ** 2, off, usual


def cross_validated(B: Array, W: Array, weights: Array, stiffness: Array) -> float:
    """Weight of bending that predicts left-out points of all images best: generalised cross validation."""
    score = np.zeros(len(FIRM))
    counts = np.zeros((2, len(FIRM)))
    held = (FIRM[:, None] * stiffness + 1e-12)[:, :, None] * np.eye(len(stiffness))
    for w, h in zip(W, weights, strict=True):
        seen = h > 0
        Bs, ws, hs = B[seen], w[:, seen].T, h[seen]
        gram, right = (Bs.T * hs) @ Bs / hs.sum(), (Bs.T * hs) @ ws / hs.sum()
        inverse = np.linalg.inv(gram + held)
        off = ws - Bs @ (inverse @ right)
        score += (hs[:, None] * off**2).sum(axis=(1, 2))
        counts[0] += hs.sum()
        counts[1] += (inverse * gram).sum(axis=(1, 2))
    return float(FIRM[np.argmin(score / counts[0] / (1 - counts[1] / counts[0]).clip(1e-3) ** 2)])


def median(values: Array) -> Array:
    """Median over the first axis of values (F, ...) without NaN; NaN where there is none."""
    ordered = np.sort(values, axis=0)
    n = np.isfinite(ordered).sum(axis=0)
    low, high = np.maximum(n - 1, 0) // 2, np.minimum(n // 2, len(values) - 1)
    picked = [np.take_along_axis(ordered, k[None], axis=0)[0] for k in (low, high)]
    return np.asarray(np.where(n > 0, (picked[0] + picked[1]) / 2, np.nan))
