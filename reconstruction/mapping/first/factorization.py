"""Rigid structure from motion by rank-3 factorisation with missing entries and metric upgrade (Tomasi & Kanade 1992).

W^f = A^f S + t^f 1ᵀ with A^f = s^f R^f: affine structure by alternation from the SVD of the complete points, then the
symmetric L = QQᵀ that makes the rows of A^f Q orthogonal and equally long.
"""

from dataclasses import dataclass

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RigidMotion

SWEEPS = 100  # of the affine fit, at most
FEWEST_FREE = 0.2  # of the entries, that tell the noise
STEADY_SCALE = 0.3  # weight of "the scale stays the same" against "the axes are orthogonal and equally long"


@dataclass(frozen=True)
class Factorization:
    """A rigid shape in the axes and pixels of the first frame, and how far to trust it.

    Attributes:
        motion: the shape and its scaled-orthographic views.
        singular_values: (4,) of the centred, completed observations: the fourth is what a rigid shape leaves unexplained.
        rms_px: reprojection error of the affine fit.
        metric_condition: smallest over largest eigenvalue of L, <= 0 where no real camera explains the views.
    """

    motion: RigidMotion
    singular_values: Array
    rms_px: float
    metric_condition: float


def view_turn_degrees(R: Array) -> float:
    """Largest angle in degrees between viewing directions of rotations (F, 3, 3): turns in the image plane do not count."""
    axes = R[:, 2, :]
    return float(np.rad2deg(np.arccos(np.clip((axes @ axes.T).min(), -1.0, 1.0))))


def factorize(W: Array, visible: Mask) -> Factorization:
    """Factorise observations (F, 2, p) px with visibility (F, p).

    The mirror image of a shape explains orthographic views as well; this returns one of the two.

    Raises:
        ReconstructionError: fewer than 3 frames, or points seen too rarely.
    """
    F, _, p = W.shape
    if F < 3 or p < 4:
        raise ReconstructionError(f"cannot factorise {F} frames of {p} points: at least 3 frames of 4 points are needed")
    A, t, S = affine_structure(W, visible)
    filled = np.where(visible[:, None], W, A @ S + t[:, :, None])
    centred = (filled - filled.mean(axis=2, keepdims=True)).reshape(2 * F, p)
    singular = np.linalg.svd(centred, compute_uv=False)[:4]
    residual = np.where(visible[:, None], W - A @ S - t[:, :, None], 0.0)
    rms = float(np.sqrt((residual**2).sum() / visible.sum()))
    Q, condition = metric_upgrade(A)
    A, S = A @ Q, np.asarray(np.linalg.solve(Q, S), np.float64)
    s = np.sqrt((A**2).sum(axis=(1, 2)) / 2)
    R = rotations_from_rows(A)
    return Factorization(RigidMotion(S, R, s, t).in_first_frame(), singular, rms, condition)


def affine_structure(W: Array, visible: Mask) -> tuple[Array, Array, Array]:
    """A (F, 2, 3), t (F, 2), S (3, p) of the affine fit, by alternating least squares over the visible entries.

    Raises:
        ReconstructionError: a frame with fewer than 4 visible points, or a point visible in fewer than 2 frames.
    """
    if visible.sum(axis=1).min() < 4 or visible.sum(axis=0).min() < 2:
        raise ReconstructionError("cannot factorise: every frame needs 4 visible points and every point 2 frames")
    F, _, p = W.shape
    h = visible.astype(np.float64)
    known = np.where(visible[:, None], W, 0.0)
    mean = known.sum(axis=2) / h.sum(axis=1)[:, None]
    track = ((known - mean[:, :, None]) * h[:, None]).sum(axis=0) / h.sum(axis=0)  # a point's mean place
    filled = np.where(visible[:, None], W, track + mean[:, :, None])
    t = filled.mean(axis=2)
    Vt = np.linalg.svd((filled - t[:, :, None]).reshape(2 * F, p), full_matrices=False)[2]
    S = Vt[:3] * np.sqrt(p)
    A = np.zeros((F, 2, 3))
    free = max(2 * h.sum() - 8 * F - 3 * p, FEWEST_FREE * h.sum())  # entries that A, t and S do not take up
    previous = np.inf

    def left_over() -> float:
        return float(((known - (A @ S + t[:, :, None]) * h[:, None]) ** 2).sum())

    for _ in range(SWEEPS):
        S = (S - S.mean(axis=1, keepdims=True)) / S.std(axis=1, keepdims=True).clip(1e-12)
        B = np.concatenate([S, np.ones((1, p))])
        motion = weighted_solve(np.einsum("ip,fp,jp->fij", B, h, B, optimize=True), known @ B.T)
        A, t = motion[:, :, :3], motion[:, :, 3]
        gram = np.einsum("fci,fp,fcj->pij", A, h, A, optimize=True)
        # S has variance 1: a few noisy entries are not to carry a point far away.
        gram += left_over() / free * np.eye(3)
        right = np.einsum("fci,fcp->pi", A, (known - t[:, :, None]) * h[:, None], optimize=True)
        S = weighted_solve(gram, right[:, None, :])[:, 0].T
        error = left_over()
        if error > previous * (1 - 1e-6):
            break
        previous = error
    t = t + A @ S.mean(axis=1)
    return A, t, S - S.mean(axis=1, keepdims=True)


def weighted_solve(gram: Array, right: Array) -> Array:
    """Solve (n, k, k) systems for right sides (n, m, k), with a touch of damping for entries hardly seen."""
    k = gram.shape[-1]
    damping = 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] / k * np.eye(k)
    return np.linalg.solve(gram + damping, right.transpose(0, 2, 1)).transpose(0, 2, 1)


def metric_upgrade(A: Array) -> tuple[Array, float]:
    """Q (3, 3) that makes the rows of A^f Q (F, 2, 3) orthogonal and equally long, and how well conditioned L = QQᵀ is."""
    x, y = A[:, 0], A[:, 1]
    i, j = np.triu_indices(3)

    def form(a: Array, b: Array) -> Array:
        return (a[:, i] * b[:, j] + a[:, j] * b[:, i]) * np.where(i == j, 0.5, 1.0)

    length = form(x, x) + form(y, y)
    size = np.linalg.norm(length, axis=1).mean()
    # Between neighbouring frames a camera hardly zooms: without this, few or noisy views let the scale explain a turn.
    steady = STEADY_SCALE * (length - length.mean(axis=0)) / size
    equations = np.concatenate([(form(x, x) - form(y, y)) / size, 2 * form(x, y) / size, steady])
    entries = np.linalg.svd(equations)[2][-1]
    L = np.zeros((3, 3))
    L[i, j] = L[j, i] = entries
    values, vectors = np.linalg.eigh(L if np.trace(L) > 0 else -L)
    condition = float(values[0] / values[2])
    # Where L is not positive definite the nearest usable one is taken; the condition says not to trust it.
    values = np.maximum(values, 1e-3 * values[2])
    return vectors * np.sqrt(values), condition


def rotations_from_rows(A: Array) -> Array:
    """The rotations (F, 3, 3) whose first two rows are nearest to those of A (F, 2, 3), up to scale."""
    U, _, Vt = np.linalg.svd(A, full_matrices=False)
    rows = U @ Vt
    return np.concatenate([rows, np.cross(rows[:, 0], rows[:, 1])[:, None]], axis=1)
