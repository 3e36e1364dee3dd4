"""Robust smooth maps between the images of a bending sheet: tracks without noise, gross errors and gaps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.basis.mesh import farthest_points
from reconstruction.mapping.surface import on_one_surface
from reconstruction.mapping.smooth_field import SmoothField, smooth_field

Array = NDArray[np.float64]
Visibility = NDArray[np.bool_]

FUNCTIONS = 100  # of the field that an image is made of
ROUGH_FUNCTIONS = 20  # of the one that only says where a point would be in the reference image
NODES = 200
SWEEPS = 8  # of re-weighting
FIRM = 10.0 ** np.arange(-7, 1.5, 0.5)  # weights of bending that are tried
GROSS = 8.0  # times the usual residual: not the same point
FINEST = 1e-4  # of the image's RMS radius: no residual is usually smaller


@dataclass(frozen=True)
class Warps:
    """F images of p points as smooth functions of where the points are in a reference image.

    Attributes:
        field: the functions, over the reference image.
        reference: (2, p) the points there, px; NaN where a point was not seen often enough.
        coefficients: (F, r, 2) of each image, px.
        weights: (F, p) of the observations, 0 where there is none.
        inlier: (F, p) observations that fit.
        noise_px: (F,) usual distance of an observation from its smooth image: standard deviation of a coordinate.
        firmness: weight of bending, found by generalised cross validation.
    """

    field: SmoothField
    reference: Array
    coefficients: Array
    weights: Array
    inlier: Visibility
    noise_px: Array
    firmness: float

    def images(self, points: Array) -> Array:
        """Where points (2, n) of the reference image are in all images, (F, 2, n) px."""
        return np.asarray((self.field.at(points) @ self.coefficients).transpose(0, 2, 1))

    def variance(self, points: Array) -> Array:
        """Variance (F, n) px² of a coordinate of those: small among visible points, large far from any."""
        return self._variance(self.field.at(points), self.weights, self.noise_px)

    def fit(self, W: Array, visible: Visibility, points: Array) -> tuple[Array, Array]:
        """Coefficients (F, r, 2) of more images W (F, 2, p) px, and the variance (F, n) of points (2, n) in them."""
        B, known = self.functions()
        pairs = zip(W, visible & known, strict=True)
        fits = [robust_fit(B, w, h, self.field.stiffness, self.firmness) for w, h in pairs]
        coefficients, weights, _, noise = (np.stack(parts) for parts in zip(*fits, strict=True))
        return coefficients, self._variance(self.field.at(points), weights, noise)

    def functions(self) -> tuple[Array, NDArray[np.bool_]]:
        """Values (p, r) of the functions at all points, 0 where unknown; which are known."""
        known = np.isfinite(self.reference[0])
        B = np.zeros((len(known), len(self.field.stiffness)))
        B[known] = self.field.at(self.reference[:, known])
        return B, known

    def _variance(self, at: Array, weights: Array, noise: Array) -> Array:
        B, _ = self.functions()
        held = np.diag(self.firmness * self.field.stiffness + 1e-12)
        out = []
        for h, sigma in zip(weights, noise, strict=True):
            inverse = np.linalg.inv((B.T * h) @ B / h.sum() + held) / h.sum()
            out.append(sigma**2 * ((at @ inverse) * at).sum(axis=1))
        return np.array(out)


def warps(W: Array, visible: Visibility) -> Warps:
    """Smooth images of W (F, 2, p) px, by visibility (F, p)."""
    reference = reference_image(W, visible)
    known = np.isfinite(reference[0])
    reference = np.where(known, reference, np.nan)
    nodes = np.flatnonzero(known)[farthest_points(reference[:, known].T, NODES)]
    field = smooth_field(reference[:, nodes], FUNCTIONS)
    B = np.zeros((W.shape[2], len(field.stiffness)))
    B[known] = field.at(reference[:, known])
    seen = visible & known
    firmness = 1e-5
    for _ in range(2):
        weights = np.stack([robust_fit(B, w, h, field.stiffness, firmness)[1] for w, h in zip(W, seen, strict=True)])
        firmness = cross_validated(B, W, weights, field.stiffness)
    fits = [robust_fit(B, w, h, field.stiffness, firmness) for w, h in zip(W, seen, strict=True)]
    coefficients, weights, inlier, noise = (np.stack(parts) for parts in zip(*fits, strict=True))
    return Warps(field, reference, coefficients, weights, inlier, noise, firmness)


def reference_image(W: Array, visible: Visibility) -> Array:
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


def robust_fit(
    B: Array, w: Array, seen: NDArray[np.bool_], stiffness: Array, firmness: float
) -> tuple[Array, Array, NDArray[np.bool_], float]:
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
