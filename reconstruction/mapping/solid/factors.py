"""Cholesky factors of many 3 × 3 matrices at once: what NumPy and SciPy have goes from one to the next."""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array


@dataclass(frozen=True)
class Factors:
    """L of p symmetric positive definite matrices M = L Lᵀ.

    Attributes:
        rows: L's six entries, row by row, (p,) each.
    """

    rows: tuple[Array, Array, Array, Array, Array, Array]

    @classmethod
    def of(cls, matrices: Array) -> "Factors":
        """Of matrices (3, 3, p)."""
        a = np.sqrt(matrices[0, 0])
        b, d = matrices[1, 0] / a, matrices[2, 0] / a
        c = np.sqrt(matrices[1, 1] - b * b)
        e = (matrices[2, 1] - d * b) / c
        return cls((a, b, c, d, e, np.sqrt(matrices[2, 2] - d * d - e * e)))

    def whitened(self, x: Array) -> Array:
        """L⁻¹ x, (..., 3, p)."""
        a, b, c, d, e, f = self.rows
        y = np.empty_like(x)
        np.divide(x[..., 0, :], a, out=y[..., 0, :])
        np.divide(x[..., 1, :] - b * y[..., 0, :], c, out=y[..., 1, :])
        np.divide(x[..., 2, :] - d * y[..., 0, :] - e * y[..., 1, :], f, out=y[..., 2, :])
        return y

    def back(self, y: Array) -> Array:
        """L⁻ᵀ y, (3, p): of what is whitened, M⁻¹ x."""
        a, b, c, d, e, f = self.rows
        x = np.empty_like(y)
        x[2] = y[2] / f
        x[1] = (y[1] - e * x[2]) / c
        x[0] = (y[0] - b * x[1] - d * x[2]) / a
        return x
