"""Depths that depend on no start: the deepest shapes of a few nodes, a convex problem, as smooth functions, adjusted.

Chhatkuli et al., CVPR 2016.
"""

from collections.abc import Sequence

import clarabel  # type: ignore[import-untyped]
import numpy as np
import scipy.sparse as sp

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.lengths import (
    Edges,
    Solver,
    adjust_depths,
    best_start,
    mean_log_lengths,
    robust_lengths,
    usual,
)
from reconstruction.mapping.isometric.nodes import NEIGHBOURS, Nodes, nearest, neighbours, rays_of
from reconstruction.mapping.outliers import medians
from reconstruction.window.robust import geman_mcclure

CONVEX_NODES = 40
PART_LEFT_OUT = 0.4  # of the points
STIFFNESS = 1e-3
SEEN = 0.3  # weight of an edge that can be relied on
START_FRAMES = 10
SOLVER = Solver()
FROM_PLANES = Solver(grow=1e-5)  # of what is right but for its bends: a pull to short lengths would lead away from it
# Times its weights of bending and of long lengths, with which depths are held at first. The first is the best start of
# paper; held so, cloth may get deeper and deeper.
WAYS = ((100.0, 1.0), (10.0, 1.0), (100.0, 100.0), (1.0, 1.0))
OTHER_STARTS = 2
DOUBTFUL = 3.0  # times the usual change of length
LITTLE_CHANGE = 0.006  # usual change of length, with which a start is good
TORN = 2.5  # the worst edges' change over the usual one: strays spoil the start


def convex_start(nodes: Nodes, part: Mask, edges: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r) of the deepest shapes of a part (m,) of the nodes in all frames of the edges, lengths unknown."""
    few = np.flatnonzero(part)[:CONVEX_NODES]
    ends, seen = ends_of(nodes, few, edges)
    depth = maximum_depth(rays_of(nodes.images[:, :, few], camera), ends, seen)
    c = coefficients_of(np.log(depth), B[few], stiffness)
    c[:, 0] -= c[:, 0].mean()
    return c


def parts_of(reference: Array) -> list[Mask]:
    """The points (2, m) of an image: all, and what is left without one side of it."""
    sides = [sign * axis for axis in reference for sign in (1, -1)]
    return [np.ones(reference.shape[1], bool), *(np.asarray(side >= np.quantile(side, PART_LEFT_OUT)) for side in sides)]


def convex_finish(nodes: Nodes, edges: Edges, like: Nodes, c: Array, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (G, r) of the deepest shapes of nodes, with the lengths that they have in other frames with c (F, r).

    Args:
        nodes: seen in G frames.
        edges: in those.
        like: the same nodes in the F others.
        c: (F, r) of those.
        B: (m, r) the functions at the nodes.
        stiffness: (r,) of the functions.
        camera: the camera.
    """
    few = np.arange(min(CONVEX_NODES, len(B)))
    ends, seen = ends_of(nodes, few, edges)
    shapes = np.exp(c @ B[few].T)[:, None] * rays_of(like.images[:, :, few], camera)
    lengths = medians(np.linalg.norm(shapes[:, :, ends[:, 0]] - shapes[:, :, ends[:, 1]], axis=1), axis=0)
    depth = maximum_depth(rays_of(nodes.images[:, :, few], camera), ends, seen, lengths)
    return coefficients_of(np.log(depth), B[few], stiffness)


def distinct(depths: Array, alike: float, *, mirrored: bool = False) -> list[int]:
    """Which of depths (n, m) differ from all of these before them by more than a share of their relief, up to their means.

    If `mirrored`, from their mirror images, too.
    """
    depths = depths - depths.mean(axis=1, keepdims=True)
    found: list[int] = []
    for k, one in enumerate(depths):
        known = depths[found]
        off = np.abs(one - known).mean(axis=1)
        off = np.minimum(off, np.abs(one + known).mean(axis=1)) if mirrored else off
        if (off > alike * np.abs(known).mean(axis=1)).all():
            found.append(k)
    return found


def ends_of(nodes: Nodes, few: Indices, edges: Edges) -> tuple[Indices, Mask]:
    """Edges (n, 2) between a few of the nodes, and in which frames (F, n) both ends are seen."""
    good = np.zeros((len(nodes.images), nodes.reference.shape[1]), bool)
    frame, edge = np.nonzero(edges.weights > SEEN)
    for end in edges.ends[edge].T:
        good[frame, end] = True
    ends = neighbours(nodes.images[:, :, few], NEIGHBOURS)
    good = good[:, few]
    return ends, good[:, ends[:, 0]] & good[:, ends[:, 1]]


def coefficients_of(log_depths: Array, B: Array, stiffness: Array) -> Array:
    """Coefficients (F, r) of log depths (F, m), NaN where not known, by the functions B (m, r) there."""
    c = np.zeros((len(log_depths), len(stiffness)))
    for f, logs in enumerate(log_depths):
        known = np.isfinite(logs)
        Bk = B[known]
        held = Bk.T @ Bk / max(1, len(Bk)) + np.diag(STIFFNESS * stiffness + 1e-6)
        c[f] = np.linalg.solve(held, Bk.T @ logs[known] / max(1, len(Bk)))
    return c


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


def first_depths(nodes: Nodes, seen: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r): depths in the first frames, and the others with their lengths."""
    frames = np.arange(len(nodes.images))
    few, rest = frames[:START_FRAMES], frames[START_FRAMES:]
    start = seen.frames(few)
    c = depths_without_start(nodes.in_frames(few), start, B, stiffness, camera)
    if not len(rest):
        return c
    logs = robust_lengths(start, start.log_lengths(c))[0]
    alike = nearest(nodes.images[rest], nodes.images[few])
    starts = [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(c)))]
    return np.concatenate([c, best_start(seen.frames(rest), logs, starts, stiffness, SOLVER.bend)])


def depths_without_start(nodes: Nodes, edges: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r) of the deepest shapes, adjusted, held firm at first: in one of several ways.

    Points of something else at a border spoil them: where lengths change much, other starts are tried, each from a part
    of the surface only. What lengths change by counts, not their share: a sheet that is very deep in all frames alike has
    very long ones, which hardly change by any share.
    """
    best, least = np.zeros((0, 0)), np.inf
    for part in parts_of(nodes.reference):
        inside = edges.weighted(np.asarray(part[nodes.ends].all(axis=1), np.float64))
        deepest = convex_start(nodes, part, edges, B, stiffness, camera)
        for bend, grow in WAYS if part.all() and not nodes.far(camera) else WAYS[:1]:
            firm = Solver(bend=bend * SOLVER.bend, grow=grow * SOLVER.grow)
            c = adjust_depths(inside, adjust_depths(inside, deepest, stiffness, firm), stiffness, SOLVER)
            c = c if part.all() else once_more(edges, edges, c, stiffness, SOLVER)[0]
            g = edges.log_lengths(c)
            share = usual(g - mean_log_lengths(edges, g))
            change = float(share * np.exp(g.mean()))
            if change < least:
                best, least = c, change
            if share < LITTLE_CHANGE:
                break
        by_edge = robust_lengths(edges, edges.log_lengths(best))[2]
        if part.all() and (share < LITTLE_CHANGE or np.quantile(by_edge, 0.95) < TORN * np.median(by_edge)):
            break
    return best


def again(
    nodes: Nodes, seen: Edges, edges: Edges, c: Array, B: Array, stiffness: Array, camera: Camera, solver: Solver
) -> tuple[Array, Array]:
    """As `once_more`, frames that fell into another minimum started from others that did not, too.

    Raises:
        ReconstructionError: there are no such depths.
    """
    off = robust_lengths(edges, edges.log_lengths(c))[1]
    if not np.isfinite(off).all():
        raise ReconstructionError("no depths along the rays keep the lengths")
    good = np.flatnonzero(off <= np.median(off))
    alike = good[nearest(nodes.images, nodes.images[good])]
    starts = [np.tile(c[good].mean(axis=0), (len(c), 1))]
    starts += [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(good)))]
    stuck = np.flatnonzero(off > np.median(off))
    if len(stuck):
        deepest, some = c.copy(), nodes.in_frames(stuck)
        deepest[stuck] = convex_finish(some, edges.frames(stuck), nodes.in_frames(good), c[good], B, stiffness, camera)
        starts.append(deepest)
    return once_more(seen, edges, c, stiffness, solver, starts)


def once_more(
    seen: Edges, edges: Edges, c: Array, stiffness: Array, solver: Solver, starts: Sequence[Array] = ()
) -> tuple[Array, Array]:
    """Adjust once more, each frame from the best of its own and other starts (F, r).

    Returns:
        coefficients (F, r); factors (n,) of the edges' weights: small for those that do not keep their length.
    """
    logs, _, change = robust_lengths(edges, edges.log_lengths(c))
    factor = geman_mcclure(change / (DOUBTFUL * np.median(change) + 1e-12))
    edges = seen.weighted(factor)
    c = best_start(edges, logs, [c, *starts], stiffness, solver.bend)
    c[:, 0] -= c[:, 0].mean()
    return adjust_depths(edges, c, stiffness, solver), factor
