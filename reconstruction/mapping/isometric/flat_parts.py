"""Depths of a sheet that is folded along creases, if it is flat between them: homographies tell each part's plane.

A homography takes points of a plane in space to those in another frame, too, but for a factor. Of all planes that may have
been seen in the reference image, the true one is that on which all homographies keep angles and lengths. This needs no
start, but perspective: without it planes that turn are many.
"""

from dataclasses import dataclass

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.images.warps import Warps
from reconstruction.mapping.isometric.nodes import rays_of

NORMALS = 3000  # that are tried: 1.5° from one to the next
STEEPEST = 0.25  # cosine of the angle between a normal and a line of sight: points seen at less are hardly followed
FLAT = 0.13  # mean change of lengths on a plane: flat parts have up to 0.05, pages that bend 0.12, cloth 0.15 and more
GROSS = 0.3  # no frame counts for more: lengths along one axis over those along the other, less 1
FEWEST = 8  # points of a part
JOINED = 12  # points on either side of a crease by which its sides are put together


@dataclass(frozen=True)
class Part:
    """A part that is flat, and moves by itself.

    Attributes:
        points: (n,) which they are.
        normal: (3,) its plane in the reference image is normal · X = 1, up to its scale.
        motions: (F, 3, 3) of points on that plane to those in frame f.
    """

    points: Indices
    normal: Array
    motions: Array

    def depths(self, rays: Array) -> Array:
        """Depths (F, m) in all frames of points on its plane, along rays (3, m) of the reference image."""
        return np.maximum(self.motions[:, 2] @ (rays / (self.normal @ rays)), 1e-9)


def folded(warps: Warps, camera: Camera) -> Array:
    """Log depths (F, p) of a sheet with creases, flat between them; NaN for points of parts with too few.

    Raises:
        ReconstructionError: no part has enough points, or one is not flat.
    """
    reference = warps.reference
    there, images = rays_of(reference[None], camera)[0], rays_of(warps.images(), camera)
    side = warps.field.sides(reference) @ (1 << np.arange(len(warps.field.creases)))
    groups = [np.flatnonzero(warps.placed & (side == one)) for one in np.unique(side[warps.placed])]
    groups = sorted((group for group in groups if len(group) >= FEWEST), key=len, reverse=True)
    if not groups:
        raise ReconstructionError("no part between creases has enough points")
    parts = [flat_part(there[:, group], images[:, :, group], group) for group in groups]
    logs = np.full((len(images), reference.shape[1]), np.nan)
    logs[:, parts[0].points] = np.log(parts[0].depths(there[:, parts[0].points]))
    left = parts[1:]
    while left:  # the nearest first
        known = np.flatnonzero(np.isfinite(logs[0]))
        apart = [((reference[:, known, None] - reference[:, None, part.points]) ** 2).sum(axis=0) for part in left]
        k = int(np.argmin([np.partition(squares.min(axis=0), 1)[1] for squares in apart]))
        part, near = left.pop(k), known[apart[k].min(axis=1).argsort()[:JOINED]]
        scale = np.median(logs[:, near] - np.log(part.depths(there[:, near])))
        logs[:, part.points] = np.log(part.depths(there[:, part.points])) + scale
    return logs - np.nanmean(logs)


def flat_part(there: Array, images: Array, points: Indices) -> Part:
    """The part of points that are seen along rays (3, n) in the reference image and (F, 3, n) in the others, third 1.

    Raises:
        ReconstructionError: it is not flat.
    """
    H = homographies(there, images)
    normals = hemisphere(NORMALS)
    normals = normals[(normals @ there > STEEPEST * np.linalg.norm(there, axis=0)).all(axis=1)]
    if not len(normals):
        raise ReconstructionError("a part between creases is seen from all sides at once")
    first = np.cross(normals, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    along, across = first @ H.transpose(0, 2, 1), np.cross(normals, first) @ H.transpose(0, 2, 1)
    squares = (along**2).sum(axis=2), (across**2).sum(axis=2)
    size = squares[0] + squares[1]
    off = np.sqrt((squares[0] - squares[1]) ** 2 + 4 * (along * across).sum(axis=2) ** 2) / size
    off = off.clip(max=GROSS).mean(axis=0)
    best = int(off.argmin())
    if off[best] > FLAT:
        raise ReconstructionError("a part between creases is not flat")
    return Part(points, normals[best], H / np.sqrt(size[:, best] / 2)[:, None, None])


def homographies(there: Array, images: Array) -> Array:
    """(F, 3, 3) that take rays (3, n) to rays (F, 3, n), third coordinate 1, by linear least squares."""
    x, none = np.broadcast_to(there.T, (len(images), *there.T.shape)), np.zeros((len(images), *there.T.shape))
    rows = [np.concatenate([*((x, none) if k == 0 else (none, x)), -images[:, k, :, None] * x], axis=2) for k in range(2)]
    H = np.linalg.svd(np.concatenate(rows, axis=1), full_matrices=False)[2][:, -1].reshape(-1, 3, 3)
    return np.asarray(H * np.sign(H[:, 2] @ there.mean(axis=1))[:, None, None])


def hemisphere(count: int) -> Array:
    """Unit vectors (count, 3) that look away from the camera, evenly spread (Fibonacci's spiral)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - k / count, np.pi * (1 + 5**0.5) * k
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z])
