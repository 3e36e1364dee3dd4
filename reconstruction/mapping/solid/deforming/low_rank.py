"""The mean shape of what deforms further than any rigid shape explains: factorisation of rank 3K, K shapes for one.

Rigid bundle adjustment follows what most points do most of the time; where limbs swing or all of it swells, poses give for
deformations. Images of K shapes, mixed anew in each, have rank 3K (Bregler, Hertzmann and Biermann, CVPR 2000), and
camera and deformation part where three columns of their motion make all rows orthogonal and equally long (Brand 2005).
"""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import nearest_rotation
from reconstruction.mapping.first.factorization import rotations_from_rows
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.deforming.learning import POINTS
from reconstruction.mapping.solid.placing import well_spread, with_others
from reconstruction.mapping.solid.views import with_unseen
from reconstruction.window.robust import deviation, fit_weights, lengths

SWEEPS = 20  # of filling gaps by the factors, and making these
CLOSE = 3.0  # deviations up to which points count nearly alike, at last
SHRINKING = 0.7  # times as many from one sweep to the next
STEPS = 100  # of the metric upgrade, at most
NOWHERE = 100.0  # times as far from the middle as is usual
ALTERNATIONS = 5  # between the mean shape and its scales


def posed(W: Array, visible: Mask, rigid: Bundle, shapes: int, far: float) -> RigidMotion:
    """The mean shape and its poses in keyframes, by factorisation.

    Args:
        W: (K, 2, p) px off the principal point; finite.
        visible: (K, p).
        rigid: the rigid shape in these keyframes: it fills gaps at first, and says how far each point's perspective
            enlarges it, and which of the shape and its mirror image is meant.
        shapes: K.
        far: as for `without_gaps`.

    Raises:
        LinAlgError: nothing rigid looks like that.
    """
    some, m = well_spread(rigid.motion.shape, visible, POINTS), rigid.motion
    depth = 1 + rigid.kappa * m.s[:, None] * (m.R[:, 2] @ m.shape)  # over the middle's
    as_rigid = m.s[:, None, None] * m.R[:, :2] @ m.shape[:, some] + m.t[:, :, None]
    filled = without_gaps((W * depth[:, None])[:, :, some], visible[:, some], as_rigid, 3 * shapes, far)
    t = filled.mean(axis=2)
    centred = filled - t[:, :, None]
    R = rotations_from_rows(metric(centred, 3 * shapes))
    s = m.s
    for _ in range(ALTERNATIONS):
        A = (s[:, None, None] * R[:, :2]).reshape(-1, 3)
        shape = np.linalg.lstsq(A, centred.reshape(len(A), -1), rcond=None)[0]
        image = R[:, :2] @ shape
        s = (image * centred).sum(axis=(1, 2)) / (image**2).sum(axis=(1, 2))
    distance = np.linalg.norm(shape, axis=0)
    if s.min() <= 0 or not distance.max() < NOWHERE * np.median(distance):  # also what is not finite
        raise np.linalg.LinAlgError("no shape for these keyframes")
    found = RigidMotion(s[0] * shape, R, s / s[0], t)
    found = max((found, found.mirrored()), key=lambda one: alike(one.R, m.R))
    found = with_others(W, visible.astype(np.float64), Bundle(found, rigid.kappa), some).motion
    return replace(found, shape=with_unseen(found.shape, np.asarray(visible.any(axis=0)), m.shape))


def without_gaps(W: Array, visible: Mask, first: Array, rank: int, far: float) -> Array:
    """Images (K, 2, p) as their factors see them where nothing is seen, and the further off what is seen is.

    Args:
        W: (K, 2, p) px; finite.
        visible: (K, p).
        first: (K, 2, p) images to begin with.
        rank: of the factors.
        far: deviations up to which points count nearly alike, at first.
    """
    K, _, p = W.shape
    low = first
    for k in range(SWEEPS):
        off = lengths(W - low)
        sigma = max(CLOSE, far * SHRINKING**k) * deviation(off[visible], np.finfo(float).tiny)
        h = (visible * fit_weights(off / sigma, close=False))[:, None]
        filled = h * W + (1 - h) * low
        t = filled.mean(axis=2, keepdims=True)
        U, s, Vt = np.linalg.svd((filled - t).reshape(2 * K, p), full_matrices=False)
        low = ((U[:, :rank] * s[:rank]) @ Vt[:rank]).reshape(K, 2, p) + t
    return filled


def metric(centred: Array, rank: int) -> Array:
    """Of centred images (K, 2, p) the columns (K, 2, 3) of their motion whose rows are nearest to a camera's axes."""
    from scipy.optimize import least_squares  # takes its time to load, and only what deforms asks

    K = len(centred)
    sized = centred / np.sqrt((centred**2).sum(axis=(1, 2), keepdims=True))
    U, s, _ = np.linalg.svd(sized.reshape(2 * K, -1), full_matrices=False)
    M = (U[:, :rank] * s[:rank]).reshape(K, 2, -1)
    M = M / np.sqrt((M[:, :, :3] ** 2).sum() / (2 * K))

    def off(entries: Array) -> Array:
        x, y = np.moveaxis(M @ entries.reshape(-1, 3), 1, 0)
        return np.concatenate([(x * x).sum(axis=1) - 1, (y * y).sum(axis=1) - 1, 2 * (x * y).sum(axis=1)])

    def slope(entries: Array) -> Array:
        x, y = np.moveaxis(M @ entries.reshape(-1, 3), 1, 0)
        X, Y = M[:, 0, :, None], M[:, 1, :, None]
        both = 2 * (X * y[:, None] + Y * x[:, None])
        return np.concatenate([2 * X * x[:, None], 2 * Y * y[:, None], both]).reshape(3 * K, -1)

    best = least_squares(off, np.eye(M.shape[2])[:, :3].ravel(), slope, max_nfev=STEPS).x
    return np.asarray(M @ best.reshape(-1, 3))


def alike(R: Array, others: Array) -> float:
    """How well rotations (K, 3, 3) fit others, whose object has other axes: 3 at best."""
    turn = nearest_rotation((R.transpose(0, 2, 1) @ others).sum(axis=0))
    return float(np.einsum("kij,jl,kil->", R, turn, others) / len(R))
