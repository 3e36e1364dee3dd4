"""Robust smooth maps between the images of a bending sheet: tracks without noise, gross errors and gaps."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.mapping.isometric.smooth_field import SmoothField, smooth_field

FUNCTIONS = 100  # of the field that an image is made of
ROUGH_FUNCTIONS = 20  # of the one that only says where a point would be in the reference image
NODES = 200
SWEEPS = 8  # of re-weighting
FIRM = 10.0 ** np.arange(-7, 1.5, 0.5)  # weights of bending that are tried
GROSS = 8.0  # times the usual residual: not the same point
FIRST_FIRMNESS = 1e-5
AGREES = 3.0  # standard deviations
FINEST = 1e-4  # of the image's RMS radius: no residual is usually smaller


@dataclass(frozen=True)
class Warps:
    """F images of p points as smooth functions of where the points are in a reference image.

    Attributes:
        field: the functions, over the reference image.
        reference: (2, p) the points there, px; NaN where a point was not seen often enough.
        kept: (p,) the points that the maps come from.
        coefficients: (F, r, 2) of each image, px.
        weights: (F, p) of the observations, 0 where there is none.
        inlier: (F, p) observations that fit.
        noise_px: (F,) usual distance of an observation from its smooth image: standard deviation of a coordinate.
        firmness: weight of bending, found by generalised cross validation.
    """

    field: SmoothField
    reference: Array
    kept: Mask
    coefficients: Array
    weights: Array
    inlier: Mask
    noise_px: Array
    firmness: float

    def images(self, points: Array) -> Array:
        """Where points (2, n) of the reference image are in all images, (F, 2, n) px."""
        return np.asarray((self.field.at(points) @ self.coefficients).transpose(0, 2, 1))

    def variance(self, points: Array) -> Array:
        """Variance (F, n) px² of a coordinate of those: small among visible points, large far from any."""
        at, B = self.field.at(points), self.functions()
        held = np.diag(self.firmness * self.field.stiffness + 1e-12)
        out = []
        for h, sigma in zip(self.weights, self.noise_px, strict=True):
            inverse = np.linalg.inv((B.T * h) @ B / h.sum() + held) / h.sum()
            out.append(sigma**2 * ((at @ inverse) * at).sum(axis=1))
        return np.array(out)

    def fit(self, W: Array, visible: Mask) -> "Warps":
        """Smooth images of more frames W (F, 2, p) px."""
        return fitted(self, W, visible, self.firmness)

    def frames(self, chosen: Array | Indices) -> "Warps":
        """Some of the images."""
        picked = {name: getattr(self, name)[chosen] for name in ("coefficients", "weights", "inlier", "noise_px")}
        return replace(self, **picked)

    def agrees(self, W: Array, visible: Mask) -> Mask:
        """Points (p,), kept or not, that usually are where the maps say, within what is known of the place."""
        known = np.isfinite(self.reference[0])
        off = np.linalg.norm(W[:, :, known] - self.images(self.reference[:, known]), axis=1)
        sigma = np.sqrt(self.variance(self.reference[:, known]) + self.noise_px[:, None] ** 2)
        usually = median(np.where(visible[:, known], off / sigma, np.nan))
        found = np.zeros(len(known), bool)
        found[known] = usually < AGREES
        return found

    def functions(self) -> Array:
        """Values (p, r) of the functions at the points kept, 0 at the others."""
        B = np.zeros((len(self.kept), len(self.field.stiffness)))
        B[self.kept] = self.field.at(self.reference[:, self.kept])
        return B


def smooth_warps(W: Array, visible: Mask, kept: Mask | None = None, reference: Array | None = None) -> Warps:
    """Smooth images of W (F, 2, p) px, by visibility (F, p).

    From the points kept (p,), all by default; over the reference image (2, p), if it is known already.
    """
    F, _, p = W.shape
    reference = reference_image(W, visible) if reference is None else reference
    known = np.isfinite(reference[0]) & (True if kept is None else kept)
    nodes = np.flatnonzero(known)[farthest_points(reference[:, known].T, NODES)]
    field = smooth_field(reference[:, nodes], FUNCTIONS)
    nothing = np.zeros((F, p))
    empty = Warps(field, reference, known, np.zeros((F, 0, 2)), nothing, nothing > 0, np.ones(F), FIRST_FIRMNESS)
    B = empty.functions()
    firmness = FIRST_FIRMNESS
    for _ in range(2):
        firmness = cross_validated(B, W, fitted(empty, W, visible, firmness).weights, field.stiffness)
    return fitted(empty, W, visible, firmness)


def fitted(warps: Warps, W: Array, visible: Mask, firmness: float) -> Warps:
    """Images W (F, 2, p) px made smooth with the functions of other warps."""
    B = warps.functions()
    pairs = zip(W, visible & warps.kept, strict=True)
    fits = [robust_fit(B, w, h, warps.field.stiffness, firmness) for w, h in pairs]
    coefficients, weights, inlier, noise = (np.stack(parts) for parts in zip(*fits, strict=True))
    return replace(warps, coefficients=coefficients, weights=weights, inlier=inlier, noise_px=noise, firmness=firmness)


def reference_image(W: Array, visible: Mask) -> Array:
    """One image (2, p) px of all points: the median of what every image, warped on to the fullest one, says.

    NaN for points that no image shows.
    """
    fullest = int(visible.sum(axis=1).argmax())
    said = np.full((len(W), 2, W.shape[2]), np.nan)
    for f, (w, h) in enumerate(zip(W, visible, strict=True)):
        both = np.flatnonzero(h & visible[fullest])
        if f == fullest or len(both) < 2 * ROUGH_FUNCTIONS:
            said[f][:, h] = w[:, h] if f == fullest else np.nan
            continue
        nodes = both[farthest_points(w[:, both].T, NODES // 2)]
        field = smooth_field(w[:, nodes], ROUGH_FUNCTIONS)
        B = field.at(w[:, h])
        target = W[fullest][:, h]
        c = robust_fit(B, target, visible[fullest][h], field.stiffness, 1e-3)[0]
        said[f][:, h] = (B @ c).T
    return median(said)


def robust_fit(B: Array, w: Array, seen: Mask, stiffness: Array, firmness: float) -> tuple[Array, Array, Mask, float]:
    """Smooth function through image points w (2, p), Geman-McClure weights, B (p, r) the functions at the points.

    Returns:
        coefficients (r, 2), weights (p,), inliers (p,), usual residual of a coordinate.
    """
    Bs, ws = B[seen], w[:, seen].T
    finest = FINEST * float(np.sqrt(np.var(ws, axis=0).sum()))
    h = np.ones(len(Bs))
    for sweep in range(SWEEPS):
        firm = max(firmness, 10.0 ** -(sweep + 1))  # gross errors must not bend it
        gram = (Bs.T * h) @ Bs / h.sum()
        c = np.linalg.solve(gram + np.diag(firm * stiffness + 1e-12), (Bs.T * h) @ ws / h.sum())
        off = np.linalg.norm(ws - Bs @ c, axis=1)
        usual = max(float(np.median(off)) / 1.1774, finest)  # of a Rayleigh distribution
        h = 1 / (1 + (off / (GROSS * usual)) ** 2) ** 2
    weights, inlier = np.zeros(len(B)), np.zeros(len(B), bool)
    weights[seen], inlier[seen] = h, off < GROSS * usual
    return c, weights, inlier, usual


def cross_validated(B: Array, W: Array, weights: Array, stiffness: Array) -> float:
    """Weight of bending that predicts left-out points of all images best: generalised cross validation."""
    score = np.zeros(len(FIRM))
    counts = np.zeros((2, len(FIRM)))
    for w, h in zip(W, weights, strict=True):
        seen = h > 0
        Bs, ws, hs = B[seen], w[:, seen].T, h[seen]
        gram, right = (Bs.T * hs) @ Bs / hs.sum(), (Bs.T * hs) @ ws / hs.sum()
        for k, firm in enumerate(FIRM):
            held = gram + np.diag(firm * stiffness + 1e-12)
            solved = np.linalg.solve(held, np.concatenate([right, gram], axis=1))
            off = ws - Bs @ solved[:, :2]
            score[k] += (hs[:, None] * off**2).sum()
            counts[:, k] += hs.sum(), np.trace(solved[:, 2:])
    return float(FIRM[np.argmin(score / counts[0] / (1 - counts[1] / counts[0]).clip(1e-3) ** 2)])


def median(values: Array) -> Array:
    """Median over the first axis of values (F, ...) without NaN; NaN where there is none."""
    ordered = np.sort(values, axis=0)
    n = np.isfinite(ordered).sum(axis=0)
    low, high = np.maximum(n - 1, 0) // 2, np.minimum(n // 2, len(values) - 1)
    picked = [np.take_along_axis(ordered, k[None], axis=0)[0] for k in (low, high)]
    return np.asarray(np.where(n > 0, (picked[0] + picked[1]) / 2, np.nan))
