"""Well-spread points of a sheet in its keyframes, the edges between them, and how well each length is seen."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Indices
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.images.smooth_field import SmoothField
from reconstruction.mapping.isometric.images.warps import Warps
from reconstruction.mapping.isometric.lengths import Edges, edges_of

NODES, NEIGHBOURS = 80, 6
FINE_NODES, FINE_NEIGHBOURS = 120, 8
USUAL_STRAIN = 0.01  # of lengths that are seen exactly
TOGETHER = 1e-12  # of the images' size, squared: points in one place, whose edge has no length
FAR = 30.0  # focal length over the images' size, RMS, from which on perspective tells nothing


@dataclass(frozen=True)
class Nodes:
    """Well-spread points of a sheet, where F keyframes see them.

    Attributes:
        points: (m,) which points they are.
        reference: (2, m) in the reference image, px.
        images: (F, 2, m) px, smoothed.
        variance: (F, m) of a coordinate there, px².
        ends: (n, 2) edges between neighbours.
        middles: (F, 2, n) px, where the middles of the edges are seen; `halfway` is where they are in the reference image.
    """

    points: Indices
    reference: Array
    images: Array
    variance: Array
    ends: Indices
    middles: Array

    @property
    def halfway(self) -> Array:
        """(2, n) middles of the edges in the reference image, px."""
        return np.asarray(self.reference[:, self.ends].mean(axis=2))

    def noise_squared(self) -> Array:
        """Change (F, n) of each edge's length by noise: squared standard deviation, over the edge's largest length."""
        i, j = self.ends.T
        longest = np.linalg.norm(self.images[:, :, i] - self.images[:, :, j], axis=1).max(axis=0)
        return np.asarray((self.variance[:, i] + self.variance[:, j]) / np.maximum(longest, 1e-12) ** 2)

    def far(self, camera: Camera) -> bool:
        """Whether they are too far away for perspective to tell a shape from its mirror image."""
        return bool(camera.focal_px > FAR * np.median(np.sqrt(self.images.var(axis=2).sum(axis=1))))

    def in_frames(self, chosen: Indices) -> "Nodes":
        """The same in some of the keyframes."""
        return replace(self, images=self.images[chosen], variance=self.variance[chosen], middles=self.middles[chosen])


def nodes_of(warps: Warps, *, fine: bool = False) -> Nodes:
    """Nodes of a sheet from its smooth images; more of them, for fine bends."""
    points = warps.few[: FINE_NODES if fine else NODES]
    images = warps.images(points)
    ends = neighbours(images, FINE_NEIGHBOURS if fine else NEIGHBOURS)
    sides = warps.field.sides(warps.reference[:, points])
    ends = ends[(sides[ends[:, 0]] == sides[ends[:, 1]]).all(axis=1)]  # across a crease no line keeps its length
    middles = warps.images_at(warps.reference[:, points[ends]].mean(axis=2))
    return Nodes(points, warps.reference[:, points], images, warps.variance(points), ends, middles)


def rays_of(images: Array, camera: Camera) -> Array:
    """Rays (F, 3, m), third coordinate 1, of image points (F, 2, m) px."""
    xy = (images - camera.center_px[:, None]) / camera.focal_px
    return np.concatenate([xy, np.ones_like(xy[:, :1])], axis=1)


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
    return np.asarray(found[farthest[tuple(found.T)] > TOGETHER])


def on_edges(nodes: Nodes, field: SmoothField) -> Array:
    """The functions of a field (3, n, r) at first end, middle and second end of each edge."""
    first, second = field.at(nodes.reference)[nodes.ends].swapaxes(0, 1)
    return np.stack([first, field.at(nodes.halfway), second])


def edges_between(nodes: Nodes, B: Array, camera: Camera) -> Edges:
    """Edges weighted by how well each length is seen: its variance by noise against the usual strain.

    `B` (3, n, r) are the functions that log depths are made of, as `on_edges` gives them.
    """
    rays, middles = (rays_of(images, camera) for images in (nodes.images, nodes.middles))
    return edges_of(rays, middles, nodes.ends, B, 1 / (1 + nodes.noise_squared() / USUAL_STRAIN**2))


def nearest(images: Array, others: Array) -> Indices:
    """(F, G) indices of other images (G, 2, m), most alike to each of the images (F, 2, m) but for its place first."""
    a, b = (x - x.mean(axis=2, keepdims=True) for x in (images, others))
    a, b = a.reshape(len(a), -1), b.reshape(len(b), -1)
    squared = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2 * a @ b.T
    order: Indices = np.argsort(squared, axis=1)
    return order
