"""A rest shape with its mode shapes Υ and principal axes Φ (paper §3.2, Eq. 3-6); how modes are made is in `modes`."""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array

ROW_NAMES = ("alpha", "beta", "tau")  # of Λ: stretching along two axes, and bending


@dataclass(frozen=True)
class ModalBasis:
    """A rest shape and its modes, S = S̄ + ΦΛΥ (Eq. 3).

    Attributes:
        rest: (3, p) centred rest shape S̄; pixels of the first frame, unless it was given in other units.
        Upsilon: (r, p) leading eigenvectors of −½CDC as rows (Eq. 4).
        eigenvalues: (r,) their eigenvalues, descending.
        Phi: (3, 3) rotation whose columns are the principal axes α, β, τ (Eq. 6).
    """

    rest: Array
    Upsilon: Array
    eigenvalues: Array
    Phi: Array

    def deform(self, Lambda: Array) -> Array:
        """Shape S (..., 3, p) of coefficients Λ (..., 3, r) (Eq. 3)."""
        return self.rest + self.Phi @ Lambda @ self.Upsilon

    def linear_basis(self) -> Array:
        """B (3r, 3, p): the same model as a linear subspace, S = S̄ + Σ_ι φ_ι B_ι with φ = vec Λ row by row (§3.3)."""
        return np.einsum("di,ap->iadp", self.Phi, self.Upsilon).reshape(-1, *self.rest.shape)


def principal_axes(rest: Array) -> Array:
    """Φ (3, 3): eigenvectors of the 3x3 scatter of S̄, largest first, made a rotation (Eq. 6)."""
    centred = rest - rest.mean(axis=1, keepdims=True)
    Phi = with_fixed_signs(np.linalg.eigh(centred @ centred.T)[1][:, ::-1])
    if np.linalg.det(Phi) < 0:
        Phi[:, 2] *= -1
    return Phi


def with_fixed_signs(vectors: Array) -> Array:
    """Columns with the sign that makes their largest entry positive, so that runs repeat exactly."""
    largest = vectors[np.abs(vectors).argmax(axis=0), np.arange(vectors.shape[1])]
    return vectors * np.where(largest < 0, -1.0, 1.0)
