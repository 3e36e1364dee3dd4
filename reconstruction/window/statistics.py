"""What a frame's points say about the 3x(4+r) matrix M, summed up once: solver iterations never touch the points.

Multiplied out, the perspective image W(1 + z/Z₀) = sRS + t is linear in M = [sR', sR'Λ, (t; 0)] acting on the fixed
basis B = [S̄'; Υ'; 1ᵀ], with R' = RΦ and S̄' = ΦᵀS̄. With w = W/f the residual of a point with basis column b is

    ρ_c = W_c − M_c b + w_c M_3 b,     c = x, y

so a frame's data term is quadratic in M with five small matrices. f → ∞ is scaled orthography (Eq. 8) on the same path.
Lengths are in units of the rest shape's RMS radius and Υ' = √p Υ, so nothing depends on image size, p or r.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reconstruction.arrays import Array
from reconstruction.basis.model import Model

BLOCK = 1024  # points summed up at a time: their weighted basis stays in the cache, a third less time at 100,000 points


@dataclass(frozen=True)
class Statistics:
    """Data terms of n frames, stacked; K = 4 + r rows of the basis.

    Attributes:
        gram: (n, 4, K, K) sums over points of h bbᵀ, h w_x bbᵀ, h w_y bbᵀ, h (w_x² + w_y²) bbᵀ, over p.
        cross: (n, 3, K) sums of h W_x b, h W_y b, h (w·W) b, over p.
        power: (n,) sums of h |W|², over p.
    """

    gram: Array
    cross: Array
    power: Array

    def __len__(self) -> int:
        return len(self.power)

    def __add__(self, other: "Statistics") -> "Statistics":
        """Of the points of both, frame by frame."""
        return Statistics(self.gram + other.gram, self.cross + other.cross, self.power + other.power)

    @property
    def seen(self) -> float:
        """Share of the points that is seen in the first frame, by their weights."""
        return float(self.gram[0, 0, -1, -1])

    @cached_property
    def form(self) -> Array:
        """(n, 3K, 3K) matrix of the quadratic form in M, row after row."""
        n, _, K, _ = self.gram.shape
        form = np.zeros((n, 3, K, 3, K))
        form[:, 0, :, 0] = form[:, 1, :, 1] = self.gram[:, 0]
        form[:, 2, :, 2] = self.gram[:, 3]
        for c in (0, 1):
            form[:, c, :, 2] = form[:, 2, :, c] = -self.gram[:, 1 + c]
        return form.reshape(n, 3 * K, 3 * K)

    @cached_property
    def modes(self) -> Array:
        """(n, 4, r²) the sums between modes."""
        n, _, K, _ = self.gram.shape
        return self.gram[:, :, 3:-1, 3:-1].reshape(n, 4, (K - 4) ** 2)

    @cached_property
    def linear(self) -> Array:
        """(n, 3, K) half the linear part in M, negative."""
        return self.cross * np.array([1.0, 1.0, -1.0])[:, None]


def frame_statistics(basis: Array, W: Array, weights: Array, focal: float) -> Statistics:
    """Statistics of one frame (n = 1): products of (4K, p) by (p, K), a block of points at a time.

    Args:
        basis: B (K, p) with the row of ones last.
        W: (2, p) image points relative to the principal point, units of the rest shape; finite where weighted.
        weights: (p,) visibility h, 0 or 1, or robust weights; or by how much these change.
        focal: focal length in the same units, `inf` for orthography.
    """
    K, p = basis.shape
    seen = weights != 0
    if not seen.all():
        basis, W, weights = basis[:, seen], W[:, seen], weights[seen]
    moments = np.empty((4, 1, len(weights)))
    moments[0] = weights / p
    moments[1:3, 0] = moments[0] * W
    moments[3] = (moments[1:3, 0] * W).sum(axis=0)
    sums = np.zeros((4 * K, K))
    for start in range(0, len(weights), BLOCK):
        part = slice(start, start + BLOCK)
        sums += (moments[:, :, part] * basis[:, part]).reshape(4 * K, -1) @ basis[:, part].T
    return from_sums(sums.reshape(1, 4, K, K), focal)


def image_statistics(model: Model, W: Array, weights: Array, *, rigid: bool = False) -> Statistics:
    """Statistics of one frame's points (2, p) px with weights (p,); `rigid`: of the rest shape alone, r = 0."""
    basis = np.concatenate([model.B[:3], model.B[-1:]]) if rigid else model.B
    return frame_statistics(basis, model.normalised(W), weights, model.focal)


def statistics_of_frames(basis: Array, W: Array, weights: Array, focal: float) -> Statistics:
    """Statistics of n frames at once, of few points (p K²/2 numbers).

    Args:
        basis: as for `frame_statistics`.
        W: (n, 2, p) the same of each frame, finite.
        weights: (n, p) the same.
        focal: the same.
    """
    return next(Products(basis).statistics(W, weights, focal, len(W)))


class Products:
    """Products of a basis's rows, two at a time: one product of matrices sums up all frames, in half as many operations.

    Args:
        basis: B (K, p) with the row of ones last.
    """

    def __init__(self, basis: Array) -> None:
        K = len(basis)
        self._one, self._other = np.triu_indices(K)
        self._products = basis[self._one] * basis[self._other]
        self._place = np.zeros((K, K), np.intp)  # of the sums between two rows
        self._place[self._one, self._other] = self._place[self._other, self._one] = np.arange(len(self._one))

    def change_rest(self, basis: Array) -> None:
        """Go over to a basis with another rest shape, but the same modes."""
        first = 3 * len(basis) - 3  # are of the first three rows
        np.multiply(basis[self._one[:first]], basis[self._other[:first]], out=self._products[:first])

    def statistics(self, W: Array, weights: Array, focal: float, at_once: int) -> Iterator[Statistics]:
        """Statistics of n frames, so many at once; arguments as for `statistics_of_frames`."""
        n, _, p = W.shape
        moments = (
            np.concatenate([np.ones((n, 1, p)), W, (W**2).sum(axis=1, keepdims=True)], axis=1) * (weights / p)[:, None]
        )
        sums = (moments.reshape(4 * n, p) @ self._products.T).reshape(n, 4, -1)
        for start in range(0, n, at_once):
            yield from_sums(sums[start : start + at_once].take(self._place, axis=2), focal)


def from_sums(sums: Array, focal: float) -> Statistics:
    """Statistics from n frames' weighted sums (n, 4, K, K) with moments 1, W_x, W_y, |W|²; column −1 of B is the ones."""
    gram = sums * np.array([1.0, 1 / focal, 1 / focal, 1 / focal**2])[:, None, None]
    cross = sums[:, 1:, :, -1] * np.array([1.0, 1.0, 1 / focal])[:, None]
    return Statistics(gram, cross, sums[:, 3, -1, -1])


def stack(parts: list[Statistics]) -> Statistics:
    """One Statistics of all frames of the parts, in order."""
    return Statistics(
        np.concatenate([s.gram for s in parts]),
        np.concatenate([s.cross for s in parts]),
        np.concatenate([s.power for s in parts]),
    )


def apply(statistics: Statistics, M: Array) -> Array:
    """The quadratic form's matrix times M: (n, k, 3, K) for directions M (n, k, 3, K)."""
    return (M.reshape(*M.shape[:2], -1) @ statistics.form).reshape(M.shape)


def value(statistics: Statistics, M: Array) -> Array:
    """Data terms (n,): Σ_i h_i |ρ_i|² / p."""
    product = apply(statistics, M[:, None])[:, 0]
    product -= 2 * statistics.linear
    product *= M
    return statistics.power + product.sum(axis=(1, 2))


def residuals(basis: Array, W: Array, M: Array, focal: float) -> Array:
    """ρ (..., 2, p) of points W (..., 2, p) by M (..., 3, K), point by point: what `value` sums up."""
    seen = M @ basis
    return np.asarray(W - seen[..., :2, :] + W / focal * seen[..., 2:, :])
