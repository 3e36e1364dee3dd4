"""A sheet that bends and does not stretch, from its keyframes alone: isometric adjustment along the rays.

No rest shape is needed: of all smooth depths along the rays, those under which every distance between neighbours is the
same in all keyframes. It needs a perspective camera; see `focal` in `sheet_evidence` for its focal length.
"""

from collections.abc import Sequence

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
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
from reconstruction.mapping.isometric.max_depth import maximum_depth
from reconstruction.mapping.isometric.nodes import NEIGHBOURS, Nodes, edges_between, nearest, neighbours, nodes_of, rays_of
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.isometric.smooth_field import smooth_field
from reconstruction.mapping.isometric.warps import smooth_warps

FUNCTIONS = 40
START_NODES, START_FRAMES = 60, 15  # of the convex start
START_STIFFNESS = 1e-3
SEEN = 0.3  # weight of an edge that can be relied on
ROUNDS = 3  # of starting frames again that do not fit
OTHER_STARTS = 4
FIRM_START = 100.0  # times the bending weight, before it is let go
DOUBTFUL = 3.0  # times the usual change of length
LITTLE_CHANGE = 0.003  # usual change of length, with which a start is good
PART_LEFT_OUT = 0.4  # of the points
DEEPEST = 1.0  # logarithm of a depth over the usual one, beyond which it says nothing: far from all points seen
SOLVER = Solver()


def sheet(
    W: Array, visible: Mask, camera: Camera, rounds: int = ROUNDS, start: IsometricSheet | None = None
) -> IsometricSheet:
    """The sheet that points W (F, 2, p) px with visibility (F, p) lie on, keyframes most different first.

    Points of something else show by distances that change, and count for little.

    Args:
        W: anything where not visible.
        visible: (F, p).
        camera: its focal length is taken as it is.
        rounds: how often frames that do not fit are started again.
        start: the sheet in these frames to start from, if there is one.

    Raises:
        ReconstructionError: the camera is orthographic, or there are fewer than 3 frames or 20 points.
    """
    if not camera.perspective:
        raise ReconstructionError("a sheet's depths along its rays need a perspective camera")
    warps = smooth_warps(W, visible)
    if len(W) < 3 or warps.placed.sum() < 20:
        raise ReconstructionError("a sheet of unknown shape needs 3 keyframes and 20 points")
    nodes = nodes_of(warps)
    field = smooth_field(nodes.reference, FUNCTIONS)
    values = np.full((len(warps.placed), len(field.stiffness)), np.nan)
    values[warps.placed] = field.at(warps.reference[:, warps.placed])
    seen = edges_between(nodes, values, camera)
    if start is None:
        c = first_depths(nodes, seen, values[nodes.points], field.stiffness, camera)
    else:
        known = start.log_depths[:, nodes.points]
        far = np.abs(known - np.nanmedian(known, axis=1, keepdims=True)) > DEEPEST
        c = coefficients_of(np.where(far, np.nan, known), values[nodes.points], field.stiffness)
    factor = np.ones(len(nodes.ends))
    for _ in range(rounds):
        c, factor = again(nodes, seen, seen.weighted(factor), c, field.stiffness)
    edges = seen.weighted(factor)
    g = edges.log_lengths(c)
    logs = mean_log_lengths(edges, g)
    off = g - logs
    return IsometricSheet(warps, nodes, field, values, c, logs, factor, edges.rms(off), usual(off), SOLVER.bend, camera)


def first_depths(nodes: Nodes, seen: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r): a convex start on the first frames, adjusted, and the others with its lengths.

    Points of something else at a border spoil the start: where lengths change much, others are tried, each from a part
    of the surface only.
    """
    few, rest = slice(0, START_FRAMES), slice(START_FRAMES, None)
    start = seen.frames(few)
    c, least = np.zeros((0, 0)), np.inf
    for part in parts_of(nodes.reference):
        inside = start.weighted(np.asarray(part[nodes.ends].all(axis=1), np.float64))
        tried = convex_start(nodes, part, start, B, stiffness, camera)
        tried = adjust_depths(inside, tried, stiffness, Solver(bend=FIRM_START * SOLVER.bend))
        tried = adjust_depths(inside, tried, stiffness, SOLVER)
        tried = tried if part.all() else once_more(start, start, tried, stiffness)[0]
        g = start.log_lengths(tried)
        change = usual(g - mean_log_lengths(start, g))
        if not len(c) or change < least:
            c, least = tried, change
        if least < LITTLE_CHANGE:
            break
    if len(nodes.images) <= START_FRAMES:
        return c
    logs = robust_lengths(start, start.log_lengths(c))[0]
    alike = nearest(nodes.images[rest], nodes.images[few])
    starts = [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(c)))]
    return np.concatenate([c, best_start(seen.frames(rest), logs, starts, stiffness, SOLVER.bend)])


def parts_of(reference: Array) -> list[Mask]:
    """The points (2, m) of an image: all, and what is left without one side of it."""
    sides = [sign * axis for axis in reference for sign in (1, -1)]
    return [np.ones(reference.shape[1], bool), *(np.asarray(side >= np.quantile(side, PART_LEFT_OUT)) for side in sides)]


def convex_start(nodes: Nodes, part: Mask, edges: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r) of the deepest shapes of few nodes, of a part (m,) of them, in the frames of the edges."""
    few = np.flatnonzero(part)[:START_NODES]
    images = nodes.images[: len(edges.weights), :, few]
    good = np.zeros((len(images), nodes.reference.shape[1]), bool)
    frame, edge = np.nonzero(edges.weights > SEEN)
    for end in edges.ends[edge].T:
        good[frame, end] = True
    ends = neighbours(images, NEIGHBOURS)
    good = good[:, few]
    depth = maximum_depth(rays_of(images, camera), ends, good[:, ends[:, 0]] & good[:, ends[:, 1]])
    c = coefficients_of(np.log(depth), B[few], stiffness)
    c[:, 0] -= c[:, 0].mean()
    return c


def coefficients_of(log_depths: Array, B: Array, stiffness: Array) -> Array:
    """Coefficients (F, r) of log depths (F, m), NaN where not known, by the functions B (m, r) there."""
    c = np.zeros((len(log_depths), len(stiffness)))
    for f, logs in enumerate(log_depths):
        known = np.isfinite(logs)
        Bk = B[known]
        held = Bk.T @ Bk / max(1, len(Bk)) + np.diag(START_STIFFNESS * stiffness + 1e-6)
        c[f] = np.linalg.solve(held, Bk.T @ logs[known] / max(1, len(Bk)))
    return c


def again(nodes: Nodes, seen: Edges, edges: Edges, c: Array, stiffness: Array) -> tuple[Array, Array]:
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
    return once_more(seen, edges, c, stiffness, starts)


def once_more(seen: Edges, edges: Edges, c: Array, stiffness: Array, starts: Sequence[Array] = ()) -> tuple[Array, Array]:
    """Adjust once more, each frame from the best of its own and other starts (F, r).

    Returns:
        coefficients (F, r); factors (n,) of the edges' weights: small for those that do not keep their length.
    """
    logs, _, change = robust_lengths(edges, edges.log_lengths(c))
    factor = 1 / (1 + (change / (DOUBTFUL * np.median(change) + 1e-12)) ** 2) ** 2
    edges = seen.weighted(factor)
    c = best_start(edges, logs, [c, *starts], stiffness, SOLVER.bend)
    c[:, 0] -= c[:, 0].mean()
    return adjust_depths(edges, c, stiffness, SOLVER), factor
