"""A sheet that bends and does not stretch, from its keyframes alone: isometric adjustment along the rays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction import ReconstructionError
from reconstruction.basis.mesh import farthest_points
from reconstruction.camera import Camera
from reconstruction.mapping.lengths import (
    Edges,
    Solver,
    adjust_depths,
    edges_of,
    finish_depths,
    frame_costs,
    mean_log_lengths,
)
from reconstruction.mapping.max_depth import maximum_depth
from reconstruction.mapping.smooth_field import SmoothField, smooth_field
from reconstruction.mapping.warps import Warps

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

NODES = 80
FUNCTIONS = 40
NEIGHBOURS = 6
START_NODES, START_FRAMES = 60, 15
ROUNDS = 3  # of starting frames again that do not fit
OTHER_STARTS = 4
FIRM_START = 100.0  # times the bending weight, before it is let go
USUAL_STRAIN = 0.01  # of lengths that are seen exactly
DOUBTFUL = 3.0  # times the usual change of length
SOLVER = Solver()


@dataclass(frozen=True)
class Nodes:
    """Well-spread points of a sheet, where F keyframes see them.

    Attributes:
        reference: (2, m) in the reference image, px.
        images: (F, 2, m) px, smoothed.
        variance: (F, m) of a coordinate there, px².
        ends: (n, 2) edges between neighbours.
    """

    reference: Array
    images: Array
    variance: Array
    ends: Indices


@dataclass(frozen=True)
class IsometricSheet:
    """Shapes of a sheet in F keyframes, and its lengths.

    Attributes:
        warps: the keyframes' images as smooth functions of the reference image.
        nodes: the points whose distances were compared.
        field: smooth functions that log depths are made of.
        coefficients: (F, r) log depths in each keyframe.
        log_lengths: (n,) of the nodes' edges: the metric rest shape.
        edge_weights: (n,) 1 for edges that keep their length, near 0 for those that do not.
        strain: (F,) rms change of length in each keyframe.
        strain_rms: rms change of length over all keyframes.
        camera: the camera.
    """

    warps: Warps
    nodes: Nodes
    field: SmoothField
    coefficients: Array
    log_lengths: Array
    edge_weights: Array
    strain: Array
    camera: Camera

    @property
    def strain_rms(self) -> float:
        """Change of length, rms over keyframes and edges."""
        return float(np.sqrt((self.strain**2).mean()))

    def shapes(self) -> Array:
        """(F, 3, p) in camera axes, all points, those not visible too; NaN for points of which nothing is known."""
        return self.along_rays(self.coefficients, self.warps.coefficients)

    def along_rays(self, coefficients: Array, images: Array) -> Array:
        """Shapes (F, 3, p) with log depths of coefficients (F, r) along the rays of images (F, R, 2) by warp coefficients."""
        known = np.isfinite(self.warps.reference[0])
        points = self.warps.reference[:, known]
        S = np.full((len(coefficients), 3, len(known)), np.nan)
        seen = (self.warps.field.at(points) @ images).transpose(0, 2, 1)
        S[:, :, known] = np.exp(coefficients @ self.field.at(points).T)[:, None] * rays_of(seen, self.camera)
        return S

    def finish(self, W: Array, visible: NDArray[np.bool_], start: Array | None = None, steps: int = 6) -> tuple[Array, Array]:
        """Shapes (F, 3, p) of other frames W (F, 2, p) px, each by itself with the lengths known; their coefficients.

        Started from coefficients (F, r), or else from the keyframes that look most alike.
        """
        images, variance = self.warps.fit(W, visible, self.nodes.reference)
        nodes = node_images(self.warps, images, self.nodes.reference)
        edges = edges_between(nodes, variance, self.nodes.ends, self.field.at(self.nodes.reference), self.camera)
        edges = edges.weighted(self.edge_weights)
        starts = [start] if start is not None else list(self.coefficients[nearest(nodes, self.nodes.images)[:, :2]].swapaxes(0, 1))
        c = best_start(edges, self.log_lengths, starts, self.field.stiffness, SOLVER.bend, steps)
        return self.along_rays(c, images), c


def rays_of(images: Array, camera: Camera) -> Array:
    """Rays (F, 3, m), third coordinate 1, of image points (F, 2, m) px."""
    xy = (images - camera.center_px[:, None]) / camera.focal_px
    return np.concatenate([xy, np.ones_like(xy[:, :1])], axis=1)


def node_images(warps: Warps, coefficients: Array, nodes: Array) -> Array:
    """(F, 2, m) px of nodes (2, m) of the reference image by warp coefficients (F, R, 2)."""
    return np.asarray((warps.field.at(nodes) @ coefficients).transpose(0, 2, 1))


def neighbours(images: Array, count: int) -> Indices:
    """Edges (n, 2) of points that stay close in all images (F, 2, m): so many nearest ones of each."""
    size = np.sqrt(np.var(images, axis=2).sum(axis=1))
    scaled = images / size[:, None, None]
    squares = (scaled**2).sum(axis=1)
    apart = squares[:, :, None] + squares[:, None, :] - 2 * scaled.transpose(0, 2, 1) @ scaled
    farthest: Array = apart.max(axis=0)
    np.fill_diagonal(farthest, np.inf)
    near = np.argsort(farthest, axis=1)[:, : min(count, len(farthest) - 1)]
    pairs = np.stack([np.repeat(np.arange(len(near)), near.shape[1]), near.ravel()], axis=1)
    found: Indices = np.unique(np.sort(pairs, axis=1), axis=0)
    return found


def edges_between(images: Array, variance: Array, ends: Indices, B: Array, camera: Camera) -> Edges:
    """Edges with weights by how well a length is seen: its variance by noise against the usual strain."""
    i, j = ends.T
    longest = np.linalg.norm(images[:, :, i] - images[:, :, j], axis=1).max(axis=0)
    by_noise = (variance[:, i] + variance[:, j]) / longest**2
    return edges_of(rays_of(images, camera), ends, B, 1 / (1 + by_noise / USUAL_STRAIN**2))


def nearest(images: Array, others: Array) -> Indices:
    """(F, G) indices of other images (G, 2, m), most alike to each of the images (F, 2, m) but for its place first."""
    a, b = (x - x.mean(axis=2, keepdims=True) for x in (images, others))
    a, b = a.reshape(len(a), -1), b.reshape(len(b), -1)
    squared = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    order: Indices = np.argsort(squared, axis=1)
    return order


def best_start(edges: Edges, logs: Array, starts: list[Array], stiffness: Array, bend: float, steps: int = 8) -> Array:
    """For each frame, of coefficients (F, r) finished from several starts those that keep lengths best."""
    ends = [finish_depths(edges, logs, c, stiffness, bend, steps) for c in starts]
    costs = np.stack([frame_costs(edges, logs, c, stiffness, bend) for c in ends])
    return np.stack(ends)[costs.argmin(axis=0), np.arange(len(ends[0]))]


def convex_start(edges: Edges, rays: Array, B: Array, stiffness: Array, images: Array) -> Array:
    """Coefficients (F, r) of the deepest shapes of few nodes."""
    few = rays[:, :, :START_NODES]
    ends = neighbours(images[:, :, :START_NODES], NEIGHBOURS)
    # an edge of few nodes is seen where both ends are
    good = np.zeros((len(rays), B.shape[0]), bool)
    for k in (0, 1):
        for f in range(len(rays)):
            good[f, edges.ends[edges.weights[f] > 0.3, k]] = True
    depth = maximum_depth(few, ends, good[:, ends[:, 0]] & good[:, ends[:, 1]])
    c = np.zeros((len(rays), B.shape[1]))
    for f, mu in enumerate(depth):
        known = np.isfinite(mu)
        Bk = B[:START_NODES][known]
        held = Bk.T @ Bk + 1e-3 * max(1, known.sum()) * np.diag(stiffness + 1e-9)
        c[f] = np.linalg.solve(held, Bk.T @ np.log(mu[known]))
    c[:, 0] -= c[:, 0].mean()
    return c


def robust_lengths(edges: Edges, g: Array) -> tuple[Array, Array, Array]:
    """Log lengths (n,) that most frames agree on, from g (F, n); rms disagreement (F,) of frames and (n,) of edges."""
    h = np.ones((len(g), 1))
    for _ in range(10):
        weights = edges.weights * h
        logs = (weights * g).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-12)
        squared = edges.weights * (g - logs) ** 2
        off = np.sqrt(squared.sum(axis=1) / np.maximum(edges.weights.sum(axis=1), 1e-12))
        h = (1 / (1 + (off / (2 * np.median(off) + 1e-12)) ** 2) ** 2)[:, None]
    by_edge = np.sqrt((h * squared).sum(axis=0) / np.maximum((h * edges.weights).sum(axis=0), 1e-12))
    return logs, off, by_edge


def adjust(warps: Warps, camera: Camera, rounds: int = ROUNDS) -> IsometricSheet:
    """The sheet seen in keyframes, most different ones first.

    Raises:
        ReconstructionError: the camera is orthographic, or there are fewer than 3 frames or 20 points.
    """
    if not camera.perspective:
        raise ReconstructionError("a sheet's depths along its rays need a perspective camera")
    known = np.flatnonzero(np.isfinite(warps.reference[0]))
    if len(warps.coefficients) < 3 or len(known) < 20:
        raise ReconstructionError("a sheet of unknown shape needs 3 keyframes and 20 points")
    chosen = known[farthest_points(warps.reference[:, known].T, NODES)]
    at = warps.reference[:, chosen]
    images, variance = node_images(warps, warps.coefficients, at), warps.variance(at)
    field = smooth_field(at, FUNCTIONS)
    B, stiffness = field.at(at), field.stiffness
    ends = neighbours(images, NEIGHBOURS)
    rays = rays_of(images, camera)
    seen = edges_between(images, variance, ends, B, camera)
    few = slice(0, START_FRAMES)
    start = seen.frames(few)
    c = convex_start(start, rays[few], B, stiffness, images[few])
    c = adjust_depths(start, c, stiffness, Solver(bend=FIRM_START * SOLVER.bend))
    c = adjust_depths(start, c, stiffness, SOLVER)
    factor = np.ones(len(ends))
    if len(rays) > START_FRAMES:
        logs, off, _ = robust_lengths(start, start.log_lengths(c))
        others = seen.frames(slice(START_FRAMES, None))
        alike = nearest(images[START_FRAMES:], images[few])
        c = np.concatenate([c, best_start(others, logs, [c[alike[:, k]] for k in range(OTHER_STARTS)], stiffness, SOLVER.bend)])
    edges = seen
    for _ in range(rounds):
        g = edges.log_lengths(c)
        logs, off, by_edge = robust_lengths(edges, g)
        factor = 1 / (1 + (by_edge / (DOUBTFUL * np.median(by_edge) + 1e-12)) ** 2) ** 2
        edges = seen.weighted(factor)
        good = np.flatnonzero(off <= np.median(off))
        alike = good[nearest(images, images[good])]
        starts = [c] + [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(good)))] + [np.tile(c[good].mean(axis=0), (len(c), 1))]
        c = best_start(edges, logs, starts, stiffness, SOLVER.bend)
        c[:, 0] -= c[:, 0].mean()
        c = adjust_depths(edges, c, stiffness, SOLVER)
    g = edges.log_lengths(c)
    logs = mean_log_lengths(edges, g)
    strain = np.sqrt((edges.weights * (g - logs) ** 2).sum(axis=1) / np.maximum(edges.weights.sum(axis=1), 1e-12))
    return IsometricSheet(warps, Nodes(at, images, variance, ends), field, c, logs, factor, strain, camera)
