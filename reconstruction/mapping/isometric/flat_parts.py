"""Depths of a sheet that is folded along creases, if it is flat between them: homographies tell each part's plane.

A homography takes points of a plane in space to those in another frame, too, but for a factor. Of all planes that may have
been seen in the reference image, the true one is that on which all homographies keep angles and lengths. This needs no
start, but perspective: without it planes that turn are many.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from reconstruction import ReconstructionError
from reconstruction.arrays import Array
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
        normal: (3,) its plane in the reference image is normal · X = 1, up to its scale.
        motions: (F, 3, 3) of points on that plane to those in frame f.
    """

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
    reference, few = warps.reference, warps.few
    there, images = rays_of(reference[None], camera)[0], rays_of(warps.images(few), camera)
    side = np.where(warps.placed, warps.field.sides(reference) @ (1 << np.arange(len(warps.field.creases))), -1)
    groups = [np.flatnonzero(side[few] == one) for one in np.unique(side[few])]
    groups = sorted((group for group in groups if len(group) >= FEWEST), key=len, reverse=True)
    if not groups:
        raise ReconstructionError("no part between creases has enough points")
    parts = [(few[group], flat_part(there[:, few[group]], images[:, :, group])) for group in groups]
    logs = np.full((len(images), reference.shape[1]), np.nan)
    known, scale, k = np.zeros(0, np.int64), 0.0, 0
    while parts:  # the largest first, then what is nearest to those there are
        if len(known):
            nearest = [np.asarray(cKDTree(reference[:, at].T).query(reference[:, known].T)[0]) for at, _ in parts]
            k = int(np.argmin([np.sort(distances)[1] for distances in nearest]))
            near = known[nearest[k].argsort()[:JOINED]]
            scale = float(np.median(logs[:, near] - np.log(parts[k][1].depths(there[:, near]))))
        points, part = parts.pop(k)
        own = side == side[points[0]]
        logs[:, own] = np.log(part.depths(there[:, own])) + scale
        known = np.concatenate([known, points])
    return logs - np.nanmean(logs)


def flat_part(there: Array, images: Array) -> Part:
    """The part whose points are seen along rays (3, n) in the reference image and (F, 3, n) in others, third coordinate 1.

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
    along, across = (way @ H.transpose(0, 2, 1) for way in (first, np.cross(normals, first)))
    one, other, both = ((a * b).sum(axis=2) for a, b in ((along, along), (across, across), (along, across)))
    off = (np.sqrt((one - other) ** 2 + 4 * both**2) / (one + other)).clip(max=GROSS).mean(axis=0)
    best = int(off.argmin())
    if off[best] > FLAT:
        raise ReconstructionError("a part between creases is not flat")
    return Part(normals[best], H / np.sqrt((one + other)[:, best] / 2)[:, None, None])


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
