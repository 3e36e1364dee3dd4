"""The mode shapes Υ of a rest shape (paper §3.2, Eq. 2-5)."""

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from reconstruction import ReconstructionError
from reconstruction.arrays import Array
from reconstruction.basis import distances, landmarks
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modal_basis import ModalBasis, principal_axes, with_fixed_signs
from reconstruction.settings import Metric

EXACT_POINTS = 4000  # with more, modes come from the distances to landmarks: all of D would take minutes and gigabytes
EXACT_JENSEN_SHANNON = 1000  # the same for Jensen-Shannon distances, which take ten times as long


def modal_basis(
    rest: Array, mesh: Mesh, modes: int, metric: Metric = "euclidean", own_motion: Array | None = None
) -> ModalBasis:
    """The r leading modes of a rest shape (3, p): exact, or of many points from their distances to landmarks.

    Args:
        rest: (3, p).
        mesh: its mesh, for distances along it.
        modes: how many.
        metric: the dissimilarity.
        own_motion: (d, p) further coordinates, by which Jensen-Shannon distances tell apart what does not move together.

    Raises:
        ReconstructionError: not 1 <= modes < p, or a mesh in pieces with the manhattan metric.
    """
    p = rest.shape[1]
    if not 1 <= modes < p:
        raise ReconstructionError(f"modes {modes} does not fit {p} points: choose 1 to {p - 1}", "modes")
    rest = rest - rest.mean(axis=1, keepdims=True)
    places = rest if own_motion is None or metric != "jensen-shannon" else np.concatenate([rest, own_motion])
    if p > exact_points(metric):
        eigenvalues, vectors = landmarks.leading_eigenpairs(places, mesh.edges, modes, metric)
        Upsilon = with_fixed_signs(vectors).T
    else:
        D = distances.dissimilarity(metric, places, mesh.edges)
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
