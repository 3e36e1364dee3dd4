"""The rest shape S̄ (paper §3.1), and a rigid shape with the poses it is seen in."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from reconstruction.arrays import Array, Indices, Mask

Kind = Literal["rigid", "plane", "isometric", "mesh", "truth"]

FLAT_RELIEF = 0.1  # of a shape's largest extent, below which it is a sheet
BESIDE = 4  # known points that say where an unknown one is


@dataclass(frozen=True)
class RigidMotion:
    """A rigid shape and how it is seen in F frames.

    Attributes:
        shape: (3, p) centred.
        R: (F, 3, 3) rotations.
        s: (F,) scales.
        t: (F, 2) image of the shape's origin relative to the principal point, px.
    """

    shape: Array
    R: Array
    s: Array
    t: Array

    def in_first_frame(self) -> "RigidMotion":
        """The same in camera axes and pixels of the first frame: R[0] = 1, s[0] = 1."""
        return replace(self, shape=self.s[0] * self.R[0] @ self.shape, R=self.R @ self.R[0].T, s=self.s / self.s[0])

    def in_order(self, frames: Indices) -> "RigidMotion":
        """The same with the frames (F,) in another order."""
        return replace(self, R=self.R[frames], s=self.s[frames], t=self.t[frames])

    def mirrored(self) -> "RigidMotion":
        """Depth reversed: explains orthographic views as well."""
        flip = np.diag([1.0, 1.0, -1.0])
        return replace(self, shape=flip @ self.shape, R=flip @ self.R @ flip)


@dataclass(frozen=True)
class RestShape:
    """S̄ with the poses of the frames it comes from.

    Attributes:
        kind: where it comes from.
        motion: shape (3, p), and poses of the bootstrap frames; one frame or more.
        note: the evidence in words, for the log.
    """

    kind: Kind
    motion: RigidMotion
    note: str

    @property
    def flat(self) -> bool:
        """Whether the shape is a sheet: hardly any relief for its size."""
        return is_flat(self.motion.shape)


def given(shape: Array, kind: Kind, note: str) -> RestShape:
    """A rest shape (3, p) from elsewhere: a mesh file, or the first true shape."""
    shape = shape - shape.mean(axis=1, keepdims=True)
    return RestShape(kind, RigidMotion(shape, np.eye(3)[None], np.ones(1), np.zeros((1, 2))), note)


def scaled_to(rest: RestShape, W: Array, visible: Mask) -> RestShape:
    """A rest shape from elsewhere with its scale in the first frame (2, p) px, by the points visible (p,).

    Of distances from the middle the medians are compared: gross errors of single points do not matter.
    """

    def size(points: Array) -> float:
        return float(np.median(np.linalg.norm(points - np.median(points, axis=1, keepdims=True), axis=0)))

    placed = (rest.motion.R[0] @ rest.motion.shape)[:2, visible]
    return replace(rest, motion=replace(rest.motion, s=np.array([size(W[:, visible]) / size(placed)])))


def is_flat(shape: Array) -> bool:
    """Whether a shape (3, p) is a sheet: hardly any relief for its size."""
    extent = np.linalg.svd(shape - shape.mean(axis=1, keepdims=True), compute_uv=False)
    return bool(extent[2] < FLAT_RELIEF * extent[0])


def rms_radius(shape: Array) -> float:
    """RMS distance of the points (3, p) to their centroid."""
    return float(np.sqrt(shape.var(axis=1).sum()))


def medoid(shapes: Array) -> int:
    """The shape (F, 3, p) that is nearest to all others, each turned as fits best."""
    centred = shapes - shapes.mean(axis=2, keepdims=True)
    nearness = np.linalg.svd(np.einsum("aip,bjp->abij", centred, centred), compute_uv=False).sum(axis=2)
    size = (centred**2).sum(axis=(1, 2))
    return int((size[:, None] + size - 2 * nearness).clip(0).sum(axis=1).argmin())


def apart(shapes: Array, others: Array, *, mirrored: bool) -> float:
    """How far shapes (K, 3, p) are off others, over their size, each turned and scaled as fits best: the mean.

    `mirrored` allows for the mirror images of all.
    """
    ours, theirs = (some - some.mean(axis=2, keepdims=True) for some in (shapes, others))
    U, values, Vt = np.linalg.svd(ours @ theirs.swapaxes(1, 2))
    sizes, side = (ours**2).sum(axis=(1, 2)) * (theirs**2).sum(axis=(1, 2)), np.sign(np.linalg.det(U @ Vt))
    fits = [values[:, 0] + values[:, 1] + one * values[:, 2] for one in ((side, -side) if mirrored else (side,))]
    return min(float(np.sqrt((1 - fit**2 / sizes).clip(0)).mean()) for fit in fits)


def completed(shape: Array, like: Array) -> Array:
    """A shape (3, p) with its unknown points, NaN, where their neighbours in another are, else at the centre."""
    unknown = np.isnan(shape[0])
    if not unknown.any():
        return shape
    whole = shape.copy()
    whole[:, unknown] = np.nanmean(shape, axis=1)[:, None]
    placed = unknown & np.isfinite(like[0])
    for i in np.flatnonzero(placed):
        beside = np.argsort(np.where(unknown, np.inf, ((like - like[:, i : i + 1]) ** 2).sum(axis=0)))[:BESIDE]
        whole[:, i] = shape[:, beside].mean(axis=1)
    return whole
