"""Convex start for a sheet that keeps its lengths: the deepest shapes (Chhatkuli et al., CVPR 2016)."""

import clarabel  # type: ignore[import-untyped]
import numpy as np
import scipy.sparse as sp

from reconstruction.arrays import Array, Indices, Mask


def maximum_depth(rays: Array, edges: Indices, seen: Mask, lengths: Array | None = None) -> Array:
    """Depths (F, m) along rays (F, 3, m), up to one scale, such that no edge (n, 2) is ever longer than its length.

    The lengths d (n,) are unknown and the same in all frames. A second-order cone programme:

        max Σ μ_i^f |q_i^f| / m   subject to   ‖μ_i^f q_i^f − μ_j^f q_j^f‖ ≤ d_ij,   Σ d = n

    An edge holds in the frames in which it is seen (F, n); a point without any comes out as NaN there. With lengths (n,)
    given, d is those.
    """
    F, _, m = rays.shape
    unit = np.linalg.norm(rays, axis=1)
    q = rays / unit[:, None]
    frame, edge = np.nonzero(seen)
    n, cones_count, (i, j) = len(edges), len(frame), edges[edge].T
    held = np.zeros((F, m), bool)
    held[frame, i] = held[frame, j] = True
    base = 1 + 4 * np.arange(cones_count)
    first, second = frame * m + i, frame * m + j
    rows, columns, values = (
        [np.zeros(n, np.int64), base],
        [F * m + np.arange(n), F * m + edge],
        [np.ones(n), -np.ones(cones_count)],
    )
    for axis in range(3):
        rows += [base + 1 + axis, base + 1 + axis]
        columns += [first, second]
        values += [-q[frame, axis, i], q[frame, axis, j]]
    shape = (1 + 4 * cones_count, F * m + n)
    A = sp.csc_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape)
    b = np.zeros(shape[0])
    b[0] = n
    goal = np.concatenate([held.ravel() * (-1.0 / m), np.zeros(n)])
    used = np.concatenate([held.ravel(), np.ones(n, bool)])
    if lengths is not None:
        b[0], b[base], used[F * m :] = 0.0, lengths[edge], False
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_gap_rel = settings.tol_gap_abs = settings.tol_feas = 1e-4  # it is only a start
    cones = [clarabel.ZeroConeT(1)] + [clarabel.SecondOrderConeT(4)] * cones_count
    size = int(used.sum())
    x = np.zeros(shape[1])
    x[used] = clarabel.DefaultSolver(sp.csc_matrix((size, size)), goal[used], A[:, used], b, cones, settings).solve().x
    depth = x[: F * m].reshape(F, m) / unit
    return np.asarray(np.where(held, np.maximum(depth, 1e-6 * depth.max()), np.nan))
