"""Scores against ground truth: e3d of the paper's §6, and its noise and missing data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import Mesh, locate
from reconstruction.camera import nearest_rotation

MIRROR = np.diag([1.0, 1.0, -1.0])


@dataclass(frozen=True)
class Score:
    """Errors as fractions of the true shape's size.

    Attributes:
        e3d: mean over frames of ‖Ŝ − S‖_F/‖S‖_F: centred, one scale and one depth sign for all, best rotation per frame.
        e3d_camera: the same without the rotation, so that a wrong pose counts.
        e3d_static: e3d of the rest shape alone, never deformed.
        e3d_sign_free: e3d if each frame's depth sign may be chosen with the truth; for comparison with other systems.
        per_frame: (K,) e3d of each truth frame.
        frames: (K,) the truth frames scored.
        points: number of points scored.
        error_over_sigma: true error of a vertex over its standard deviation, RMS over a frame, median over the frames; None
            without standard deviations.
    """

    e3d: float
    e3d_camera: float
    e3d_static: float
    e3d_sign_free: float
    per_frame: Array
    frames: Indices
    points: int
    error_over_sigma: float | None = None


def score(shapes: Array, rest: Array, truth: Array, frames: Indices, sigma: Array | None = None) -> Score:
    """Compare shapes (K, 3, n), with sigma (K, n), and rest shape (3, n) with true shapes (K, 3, n) of frames (K,).

    Points of which the truth is not finite are not scored in that frame; three at least have to be.
    """
    per_frame = e3d(shapes, truth)
    still = np.broadcast_to(rest, truth.shape)
    return Score(
        e3d=float(per_frame.mean()),
        e3d_camera=float(e3d(shapes, truth, turned=False).mean()),
        e3d_static=float(e3d(still, truth).mean()),
        e3d_sign_free=float(e3d(shapes, truth, sign_free=True).mean()),
        per_frame=per_frame,
        frames=frames,
        points=int(known_in(truth).any(axis=0).sum()),
        error_over_sigma=None if sigma is None else error_over_sigma(shapes, sigma, truth),
    )


def e3d(shapes: Array, truth: Array, *, turned: bool = True, sign_free: bool = False) -> Array:
    """Error (K,) of shapes (K, 3, n) against truth (K, 3, n).

    `turned` grants each frame its best rotation, `sign_free` its own depth sign instead of one for all frames.
    """
    placed, truth, _ = aligned(shapes, truth, turned=turned, sign_free=sign_free)
    return np.asarray(np.linalg.norm(placed - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2)))


def error_over_sigma(shapes: Array, sigma: Array, truth: Array) -> float:
    """Errors of shapes (K, 3, n) against truth (K, 3, n) over their standard deviations (K, n); median over the frames.

    A frame whose shape was given has no uncertainty, and is not counted.
    """
    placed, true, scale = aligned(shapes, truth)
    squares = ((placed - true) ** 2).sum(axis=(1, 2)) / scale**2
    variances = (sigma**2).sum(axis=1, where=known_in(truth))
    told = variances > 0
    return float(np.median(np.sqrt(squares[told] / variances[told])))


def aligned(shapes: Array, truth: Array, *, turned: bool = True, sign_free: bool = False) -> tuple[Array, Array, float]:
    """Shapes (K, 3, n) as near to truth (K, 3, n) as they can be made, see `e3d`; the truth; and their scale.

    Both are centred, and 0 where the truth is not finite.
    """
    known = known_in(truth)
    shapes, truth = centred(shapes, known), centred(truth, known)
    candidates = [shapes, MIRROR @ shapes]
    if turned:
        candidates = [nearest_rotation(truth @ S.transpose(0, 2, 1)) @ S for S in candidates]
    if sign_free:  # both signs have the same size, so the one that correlates more is nearer at any scale
        ours, mirrored = ((S * truth).sum(axis=(1, 2)) for S in candidates)
        candidates = [np.where((ours >= mirrored)[:, None, None], *candidates)]
    scales = [float((S * truth).sum() / (S * S).sum()) for S in candidates]
    size = np.linalg.norm(truth, axis=(1, 2))
    errors = [np.linalg.norm(scale * S - truth, axis=(1, 2)) / size for scale, S in zip(scales, candidates, strict=True)]
    best = int(np.argmin([error.mean() for error in errors]))
    return scales[best] * candidates[best], truth, scales[best]


def known_in(truth: Array) -> Mask:
    """Which points (K, n) of true shapes (K, 3, n) are known."""
    return np.asarray(np.isfinite(truth).all(axis=1))


def centred(S: Array, known: Mask) -> Array:
    """Shapes (K, 3, n) about the middle of the points known (K, n); the others are 0, so that they count for nothing."""
    there = known[:, None]
    middle = np.where(there, S, 0.0).sum(axis=2, keepdims=True) / there.sum(axis=2, keepdims=True)
    return np.where(there, S - middle, 0.0)


def followed(
    shapes: Sequence[Array], projections: Sequence[Array], rest: Array, mesh: Mesh, truth_px: Array
) -> tuple[Array, Array, Mask]:
    """Where truth points seen at truth_px (n, 2) in the first truth frame are on the moving mesh.

    Args:
        shapes: K vertex positions (3, p) in the truth frames, or more rows, of anything that goes with them.
        projections: their images (p, 2); only the first is used.
        rest: (3, p) rest shape.
        mesh: connectivity of the vertices.
        truth_px: (n, 2) pixels of the truth points in the first truth frame.

    Returns:
        points (K, 3, m), with those rows, and rest points (3, m), barycentric in the mesh; inside (n,) which truth points
        those are.

    Raises:
        ReconstructionError: fewer than 3 truth points lie in the mesh.
    """
    face, weights = locate(projections[0], mesh, truth_px)
    inside = face >= 0
    if inside.sum() < 3:
        raise ReconstructionError("fewer than 3 truth points lie inside the mesh in the first truth frame", "region")
    corners, weights = mesh.faces[face[inside]], weights[inside]

    def at(S: Array) -> Array:
        return np.einsum("dnk,nk->dn", S[:, corners], weights)

    return np.stack([at(S) for S in shapes]), at(rest), inside


def with_noise(W: Array, level: float, rng: np.random.Generator) -> Array:
    """Observations (F, 2, p) with Gaussian noise of `level` times the largest distance to the centroid (paper §6)."""
    seen = np.isfinite(W)
    centroid = W.sum(axis=2, where=seen, keepdims=True) / np.maximum(seen.sum(axis=2, keepdims=True), 1)
    distance = np.linalg.norm(W - centroid, axis=1)
    sigma = level * float(distance.max(initial=0.0, where=seen.all(axis=1)))
    return W + rng.normal(0.0, sigma, W.shape)


def with_missing(visible: Mask, share: float, rng: np.random.Generator) -> Mask:
    """Mask (F, p) with a share of its entries hidden uniformly at random."""
    return visible & (rng.random(visible.shape) >= share)


def with_outliers(W: Array, visible: Mask, share: float, rng: np.random.Generator) -> Array:
    """Observations (F, 2, p) of which a share lies anywhere in the bounding box of what is visible (F, p)."""
    gross = visible & (rng.random(visible.shape) < share)
    if not gross.any():
        return W
    seen = W.transpose(0, 2, 1)[visible]
    low, high = seen.min(axis=0)[:, None], seen.max(axis=0)[:, None]
    return np.where(gross[:, None], rng.uniform(low, high, W.shape), W)
