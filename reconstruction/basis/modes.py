"""Mode shapes Υ and principal axes Φ of a rest shape (paper §3.2, Eq. 2-6)."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from reconstruction import ReconstructionError
from reconstruction.arrays import Array
from reconstruction.basis import distances, landmarks
from reconstruction.basis.mesh import Mesh
from reconstruction.settings import Metric

ROW_NAMES = ("alpha", "beta", "tau")  # of Λ: stretching along two axes, and bending
EXACT_POINTS = 4000  # with more, modes come from the distances to landmarks: all of D would take minutes and gigabytes
EXACT_JENSEN_SHANNON = 1000  # the same for Jensen-Shannon distances, which take ten times as long


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


def modal_basis(rest: Array, mesh: Mesh, modes: int, metric: Metric = "euclidean") -> ModalBasis:
    """The r leading modes of a rest shape (3, p): exact, or of many points from their distances to landmarks.

    Raises:
        ReconstructionError: not 1 <= modes < p, or a mesh in pieces with the manhattan metric.
    """
    p = rest.shape[1]
    if not 1 <= modes < p:
        raise ReconstructionError(f"modes {modes} does not fit {p} points: choose 1 to {p - 1}", "modes")
    rest = rest - rest.mean(axis=1, keepdims=True)
    if p > exact_points(metric):
        eigenvalues, vectors = landmarks.leading_eigenpairs(rest, mesh.edges, modes, metric)
        Upsilon = with_fixed_signs(vectors).T
    else:
        D = distances.dissimilarity(metric, rest, mesh.edges)
        eigenvalues, Upsilon = leading_eigenpairs(doubly_centred(D), modes)
    return ModalBasis(rest, Upsilon, eigenvalues, principal_axes(rest))


def exact_points(metric: Metric) -> int:
    """Most points whose distances are all computed."""
    return EXACT_JENSEN_SHANNON if metric == "jensen-shannon" else EXACT_POINTS


def doubly_centred(D: Array) -> Array:
    """D̄ = −½ C D C (p, p) of the distance matrix D; D is not squared, so D̄ has p−1 positive eigenvalues (Eq. 2)."""
    row = D.mean(axis=0, keepdims=True)
    return -0.5 * (D - row - row.T + row.mean())


def leading_eigenpairs(matrix: Array, count: int) -> tuple[Array, Array]:
    """The `count` largest eigenvalues, descending, and eigenvectors (count, p) of a symmetric matrix (p, p)."""
    p = len(matrix)
    if p < 200 or count > p // 4:
        values, vectors = eigh(matrix, subset_by_index=(p - count, p - 1))
    else:
        # Lanczos from a fixed start: an irregular vector that is deterministic and excites every mode.
        values, vectors = eigsh(matrix, k=count, which="LA", v0=np.cos(np.arange(p) ** 1.5))
    order = np.argsort(values)[::-1]
    return values[order], with_fixed_signs(vectors[:, order]).T


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
