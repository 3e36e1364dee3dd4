"""Depths that depend on no start: the deepest shapes of a few nodes, a convex problem, as smooth functions."""

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.lengths import Edges
from reconstruction.mapping.isometric.max_depth import maximum_depth
from reconstruction.mapping.isometric.nodes import NEIGHBOURS, Nodes, neighbours, rays_of
from reconstruction.mapping.outliers import medians

CONVEX_NODES = 40
STIFFNESS = 1e-3
SEEN = 0.3  # weight of an edge that can be relied on


def convex_start(nodes: Nodes, part: Mask, edges: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r) of the deepest shapes of a part (m,) of the nodes in all frames of the edges, lengths unknown."""
    few = np.flatnonzero(part)[:CONVEX_NODES]
    ends, seen = ends_of(nodes, few, edges)
    depth = maximum_depth(rays_of(nodes.images[:, :, few], camera), ends, seen)
    c = coefficients_of(np.log(depth), B[few], stiffness)
    c[:, 0] -= c[:, 0].mean()
    return c


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
