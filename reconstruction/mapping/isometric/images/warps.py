"""Robust smooth maps between the images of a bending sheet: tracks without noise, gross errors and gaps."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.mapping.isometric.images.reference import reference_image
from reconstruction.mapping.isometric.images.smooth_field import (
    FEW_FUNCTIONS,
    FINEST,
    NO_CREASES,
    ROUGH_SWEEPS,
    SmoothField,
    robust_fit,
    smooth_field,
    spread_rows,
    weighted_fit,
    weights_of,
)
from reconstruction.mapping.outliers import without_outliers
from reconstruction.principal import principal
from reconstruction.window.robust import lengths

FUNCTIONS, FINE_FUNCTIONS = 100, 150  # of the field that an image is made of
NODES = 200
FEW = 250  # well-spread points that are enough to tell gross errors
FEWEST = 3  # of them that each image must show
TRIED = 8  # images by which the weight of bending is found
DEPTHS = 3  # ways in which points of a solid that is seen through are off its smooth images
FAR = 4.0  # times as far off as usual
FIRM = 10.0 ** np.arange(-7, 1.5, 0.5)  # weights of bending that are tried
FIRST_FIRMNESS = 1e-5


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
    noise_px: Array
    firmness: float

    def images(self, points: Mask | Indices | slice = slice(None)) -> Array:
        """Where points are in all images, (F, 2, n) px."""
        return np.asarray((self.values[points] @ self.coefficients).transpose(0, 2, 1))

    def images_at(self, places: Array) -> Array:
        """The same (F, 2, n) px of any places (2, n) of the reference image."""
        return np.asarray((self.field.at(places) @ self.coefficients).transpose(0, 2, 1))

    def values_of(self, field: SmoothField) -> Array:
        """(p, r) of other functions over the reference image at all points; NaN where a point has no place."""
        values = np.full((len(self.placed), len(field.stiffness)), np.nan)
        values[self.placed] = field.at(self.reference[:, self.placed])
        return values

    @property
    def noise_over_size(self) -> float:
        """Usual noise over the images' RMS radius."""
        size = np.sqrt(self.images(self.placed).var(axis=2).sum(axis=1))
        return float(np.median(self.noise_px / size.clip(1e-300)))

    def parallax_over_size(self, W: Array, visible: Mask) -> float:
        """Of that, what points of images W (F, 2, p) px, visible (F, p), do together: no noise, but depth seen through."""
        known = visible & self.placed
        off = np.where(known[:, None], W - self.images(), 0.0)
        length = lengths(off)
        most = FAR * float(np.median(length[known]))
        off *= np.minimum(1.0, most / np.maximum(length, 1e-300))[:, None]  # gross errors are no farther off than others
        return self.noise_over_size * float(np.sqrt(principal(off, known, DEPTHS)[1]))

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
            noise_px=self.noise_px[chosen],
        )

    def moved(self, places: Array) -> "Warps":
        """The same functions, points with other places (2, p) on the reference image."""
        values = np.zeros_like(self.values)
        values[self.placed] = self.field.at(places[:, self.placed])
        return replace(self, reference=places, values=values)


def smooth_warps(W: Array, visible: Mask) -> Warps:
    """Smooth images of W (F, 2, p) px, by visibility (F, p).

    Raises:
        ReconstructionError: an image has hardly any points in common with the others.
    """
    reference = reference_image(W, without_outliers(W, visible))  # one where few are seen would bend the map to it
    placed: Mask = np.isfinite(reference[0])
    few = np.flatnonzero(placed)[farthest_points(reference[:, placed].T, FEW)]
    if visible[:, few].sum(axis=1).min() < FEWEST:
        raise ReconstructionError(f"a keyframe shows fewer than {FEWEST} points that others show, too")
    return on_reference(reference, few, placed, FUNCTIONS, W, visible)


def finer(warps: Warps, W: Array, visible: Mask) -> Warps:
    """The same images made smooth by more functions."""
    return on_reference(warps.reference, warps.few, warps.placed, FINE_FUNCTIONS, W, visible, warps.field.creases)


def creased(warps: Warps, W: Array, visible: Mask, creases: Array) -> Warps:
    """The same images made smooth but for creases (k, 3) in the reference image."""
    return on_reference(warps.reference, warps.few, warps.placed, FUNCTIONS, W, visible, creases)


def on_reference(
    reference: Array, few: Indices, placed: Mask, functions: int, W: Array, visible: Mask, creases: Array = NO_CREASES
) -> Warps:
    """Smooth images of W (F, 2, p) px, by visibility (F, p), of so many functions; the others as in `Warps`."""
    field = smooth_field(reference[:, few[:NODES]], functions, creases)
    values = np.zeros((W.shape[2], len(field.stiffness)))
    values[placed] = field.at(reference[:, placed])
    none, nothing, noise = np.zeros((len(W), 0, 2)), np.zeros((len(W), W.shape[2])), np.ones(len(W))
    empty = Warps(field, reference, values, few, placed, none, nothing, noise, FIRST_FIRMNESS)
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
    coefficients, weights, noise = (np.stack(parts) for parts in zip(*fits, strict=True))
    return replace(warps, coefficients=coefficients, weights=weights, noise_px=noise, firmness=firmness)


def quick_fit(warps: Warps, w: Array, visible: Mask, points: Indices) -> tuple[Array, Array, Array]:
    """One more image w (2, p) px made smooth: as `robust_fit` does, but by the few points only.

    Returns:
        coefficients (r, 2), variance (n,) px² of a coordinate of some points, weights (p,) px⁻² of the observations.
    """
    B, stiffness, every = warps.values, warps.field.stiffness, np.flatnonzero(visible & warps.placed)
    some = spread_rows(visible & warps.placed, warps.few)
    few, target, h = B[some], w[:, some].T, np.ones(len(some))
    finest = FINEST * float(np.sqrt(np.var(target, axis=0).sum()))
    rough = few[:, :FEW_FUNCTIONS]
    for sweep in range(ROUGH_SWEEPS):
        c, _ = weighted_fit(rough, target, h, 0.1 ** (sweep + 1) * stiffness[:FEW_FUNCTIONS])
        h, _ = weights_of(target - rough @ c, finest)
    c, gram = weighted_fit(few, target, h, warps.firmness * stiffness)
    image, weights = B @ c, np.zeros(len(B))
    h, usual = weights_of(w[:, every].T - image[every], finest)
    weights[every] = h / usual**2
    at = B[points]
    return c, usual**2 / h.sum() * ((at @ np.linalg.inv(gram)) * at).sum(axis=1), weights


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
    return float(FIRM[np.argmin(score / counts[0] / (1 - counts[1] / counts[0]).clip(1e-9) ** 2)])
