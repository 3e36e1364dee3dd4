"""A sheet that bends and does not stretch, from its keyframes alone: isometric adjustment along the rays.

No rest shape is needed: of all smooth depths along the rays, those under which every distance between neighbours is the
same in all keyframes. It needs a perspective camera; see `focal` in `sheet_evidence` for its focal length.
"""

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
)
from reconstruction.mapping.isometric.max_depth import maximum_depth
from reconstruction.mapping.isometric.nodes import NEIGHBOURS, Nodes, edges_between, nearest, neighbours, nodes_of, rays_of
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.isometric.smooth_field import SmoothField, smooth_field
from reconstruction.mapping.isometric.warps import Warps, smooth_warps

FUNCTIONS = 40
START_NODES, START_FRAMES = 60, 15  # of the convex start
START_STIFFNESS = 1e-3
SEEN = 0.3  # weight of an edge that can be relied on
ROUNDS = 3  # of starting frames again that do not fit
OTHER_STARTS = 4
FIRM_START = 100.0  # times the bending weight, before it is let go
DOUBTFUL = 3.0  # times the usual change of length
FEWEST_STRAYS, MOST_STRAYS = 0.005, 0.3  # of the points: fewer are not worth another look, more are no strays
LOOKS = 3
SOLVER = Solver()


def sheet(W: Array, visible: Mask, camera: Camera) -> IsometricSheet:
    """The sheet that points W (F, 2, p) px with visibility (F, p) lie on, keyframes most different first.

    Points of something else, at the sheet's border mostly, show by distances that change, and are left out.

    Raises:
        ReconstructionError: the camera is orthographic, or there are fewer than 3 frames or 20 points.
    """
    warps = smooth_warps(W, visible)
    found = adjust(warps, camera)
    for _ in range(LOOKS - 1):
        stray = found.strays()
        if stray.mean() < FEWEST_STRAYS:
            break
        warps = smooth_warps(W, visible, warps.kept & ~stray, warps.reference)
        kept = warps.kept | warps.agrees(W, visible)
        if kept.mean() < 1 - MOST_STRAYS:
            break
        warps = smooth_warps(W, visible, kept, warps.reference)
        found = adjust(warps, camera)
    return found


def adjust(warps: Warps, camera: Camera, rounds: int = ROUNDS) -> IsometricSheet:
    """The sheet whose smooth images are given, keyframes most different first.

    Raises:
        ReconstructionError: the camera is orthographic, or there are fewer than 3 frames or 20 points.
    """
    if not camera.perspective:
        raise ReconstructionError("a sheet's depths along its rays need a perspective camera")
    if len(warps.coefficients) < 3 or warps.kept.sum() < 20:
        raise ReconstructionError("a sheet of unknown shape needs 3 keyframes and 20 points")
    nodes = nodes_of(warps)
    field = smooth_field(nodes.reference, FUNCTIONS)
    seen = edges_between(nodes, field, camera)
    c, factor = first_depths(nodes, seen, field, camera), np.ones(len(nodes.ends))
    for _ in range(rounds):
        c, factor = again(nodes, seen, seen.weighted(factor), c, field.stiffness)
    edges = seen.weighted(factor)
    g = edges.log_lengths(c)
    logs = mean_log_lengths(edges, g)
    return IsometricSheet(warps, nodes, field, c, logs, factor, edges.rms(g - logs), SOLVER.bend, camera)


def first_depths(nodes: Nodes, seen: Edges, field: SmoothField, camera: Camera) -> Array:
    """Coefficients (F, r): a convex start on the first frames, adjusted, and the others with its lengths."""
    few, rest = slice(0, START_FRAMES), slice(START_FRAMES, None)
    start, stiffness = seen.frames(few), field.stiffness
    c = convex_start(nodes, start, field, camera)
    c = adjust_depths(start, c, stiffness, Solver(bend=FIRM_START * SOLVER.bend))
    c = adjust_depths(start, c, stiffness, SOLVER)
    if len(nodes.images) <= START_FRAMES:
        return c
    logs = robust_lengths(start, start.log_lengths(c))[0]
    alike = nearest(nodes.images[rest], nodes.images[few])
    starts = [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(c)))]
    return np.concatenate([c, best_start(seen.frames(rest), logs, starts, stiffness, SOLVER.bend)])


def convex_start(nodes: Nodes, edges: Edges, field: SmoothField, camera: Camera) -> Array:
    """Coefficients (F, r) of the deepest shapes of few nodes in the frames of the edges."""
    images = nodes.images[: len(edges.weights), :, :START_NODES]
    good = np.zeros((len(images), nodes.reference.shape[1]), bool)
    frame, edge = np.nonzero(edges.weights > SEEN)
    for end in edges.ends[edge].T:
        good[frame, end] = True
    ends = neighbours(images, NEIGHBOURS)
    depth = maximum_depth(rays_of(images, camera), ends, good[:, ends[:, 0]] & good[:, ends[:, 1]])
    B, c = field.at(nodes.reference[:, :START_NODES]), np.zeros((len(images), len(field.stiffness)))
    for f, mu in enumerate(depth):
        known = np.isfinite(mu)
        Bk = B[known]
        held = Bk.T @ Bk / max(1, len(Bk)) + np.diag(START_STIFFNESS * field.stiffness + 1e-6)
        c[f] = np.linalg.solve(held, Bk.T @ np.log(mu[known]) / max(1, len(Bk)))
    c[:, 0] -= c[:, 0].mean()
    return c


def again(nodes: Nodes, seen: Edges, edges: Edges, c: Array, stiffness: Array) -> tuple[Array, Array]:
    """Adjust once more, frames that fell into another minimum started from others that did not.

    Returns:
        coefficients (F, r); factors (n,) of the edges' weights: small for those that do not keep their length.
    """
    logs, off, change = robust_lengths(edges, edges.log_lengths(c))
    factor = 1 / (1 + (change / (DOUBTFUL * np.median(change) + 1e-12)) ** 2) ** 2
    edges = seen.weighted(factor)
    good = np.flatnonzero(off <= np.median(off))
    alike = good[nearest(nodes.images, nodes.images[good])]
    starts = [c, np.tile(c[good].mean(axis=0), (len(c), 1))]
    starts += [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(good)))]
    c = best_start(edges, logs, starts, stiffness, SOLVER.bend)
    c[:, 0] -= c[:, 0].mean()
    return adjust_depths(edges, c, stiffness, SOLVER), factor
