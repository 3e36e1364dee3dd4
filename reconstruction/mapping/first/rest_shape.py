"""The rest shape S̄ from the first frames: a rigid shape, or a flat sheet (paper §4)."""

from dataclasses import replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RestShape, RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.first.evidence import (
    STILL,
    TURN_DEGREES,
    apparent_change,
    extent,
    foreshortening_degrees,
    judging_points,
)
from reconstruction.mapping.first.factorization import affine_structure, factorize, view_turn_degrees
from reconstruction.mapping.first.rigid import bundle_adjust
from reconstruction.mapping.solid import solid
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.hollow import disbelief
from reconstruction.mapping.solid.placing import FEWEST_POINTS, beside_others

VIEWS = 16  # of the first frames are enough for a plane
BENT = 0.012  # reprojection error over the image's extent, above which a sheet is not flat in all frames
FEWEST_FLAT = 10  # frames that tell a tilt
FAR = 3.0  # times the median distance from the middle, beyond which a point's depth is not believed


def rigid(W: Array, visible: Mask, camera: Camera) -> RestShape:
    """S̄ by factorisation and rigid bundle adjustment of observations (F, 2, p) px (Tomasi & Kanade 1992).

    Raises:
        ReconstructionError: the object turned too little for its depth to show, or too few frames or points.
    """
    chosen = judging_points(W, visible)
    turned = foreshortening_degrees(W[:, :, chosen], visible[:, chosen])
    if apparent_change(W[:, :, chosen], visible[:, chosen]) <= STILL:
        raise ReconstructionError(
            f"cannot recover a rest shape: the object turned {turned:.1f}° in {len(W)} frames, about "
            f"{TURN_DEGREES:.0f}° are needed",
            "rest_shape",
        )
    start = factorize_often_seen(W, visible)
    start = replace(start, t=start.t - camera.center_px)
    starts = [start, start.mirrored()] if camera.perspective else [start]
    off, places = W - camera.center_px[:, None], first_image(W, visible)

    def counted(motion: RigidMotion, rms: float) -> float:
        """The mean square px² left over, more if the shape is hollow: things are seen from outside."""
        return rms**2 * disbelief(Bundle(motion, 1 / camera.focal_px), off, visible, places)

    motion, rms = min((bundle_adjust(W, visible, s, camera) for s in starts), key=lambda one: counted(*one))
    motion = motion.in_first_frame()
    turn = view_turn_degrees(motion.R)
    note = f"rigid shape from {len(W)} frames, turned {turn:.0f}°, reprojection error {rms:.2f} px"
    return RestShape("rigid", motion, note)


def factorize_often_seen(W: Array, visible: Mask) -> RigidMotion:
    """Factorise the points seen in enough frames; the others start where they are seen, as deep as those beside them.

    So do points that come out far from all others.

    Raises:
        ReconstructionError: too few frames or points.
    """
    often = visible.sum(axis=0) >= min(len(W), max(3, 0.2 * len(W)))
    if often.sum() < 4:
        raise ReconstructionError("cannot recover a rest shape: fewer than 4 points stay visible", "rest_shape")
    while True:
        motion = factorize(W[:, :, often], visible[:, often]).motion
        distance = np.linalg.norm(motion.shape - np.median(motion.shape, axis=1, keepdims=True), axis=0)
        near = distance < FAR * np.median(distance)
        if near.all() or near.sum() < 4:
            break
        often[often] = near  # too few views, too much alike: the others would suffer, too
    shape = np.zeros((3, W.shape[2]))
    shape[:, often] = motion.shape
    shape = beside_others(W, visible, Bundle(replace(motion, shape=shape), 0.0), ~often)
    return replace(motion, shape=shape)


def plane(W: Array, visible: Mask, camera: Camera) -> RestShape:
    """A flat sheet, tilted as the first frames say: as many of them as one plane explains.

    Raises:
        ReconstructionError: fewer than 4 points visible in a frame.
    """
    if visible.sum(axis=1).min() < 4:
        raise ReconstructionError("cannot recover a rest shape: fewer than 4 points are visible")
    first, chosen = first_image(W, visible), judging_points(W, visible)
    count = len(W)
    few = count < FEWEST_FLAT or len(chosen) < FEWEST_POINTS
    if few or apparent_change(W[:, :, chosen], visible[:, chosen]) <= STILL:
        why = "too few points or frames tell its tilt" if few else "nothing turns yet"
        return RestShape("plane", tilted_sheet(first, np.eye(3), camera), f"flat sheet facing the camera: {why}")
    while True:
        frames = np.unique(np.linspace(0, count - 1, VIEWS).astype(int))
        views = np.where(visible[frames][:, None], W[frames], np.nan)[:, :, chosen]
        found = solid.bundle_adjust(views, visible[frames][:, chosen], camera, refine_focal=False, flat=True)
        left = float(np.nanmedian(found.residual_px))
        if left <= BENT * extent(first) or count < 2 * FEWEST_FLAT:  # else it bends meanwhile: by the frames before
            break
        count //= 2
    U = np.linalg.svd(found.shape, full_matrices=False)[0]  # its plane in the first frame
    R = U if np.linalg.det(U) > 0 else U * [1, 1, -1]
    motion = tilted_sheet(first, R, camera)
    tilt = np.rad2deg(np.arccos(np.clip(abs(R[2, 2]), 0, 1)))
    note = f"flat sheet tilted {tilt:.0f}° in the first frame, by {count} frames, median residual {left:.2f} px"
    return RestShape("plane", motion.in_first_frame(), note)


def tilted_sheet(image: Array, R: Array, camera: Camera) -> RigidMotion:
    """The flat sheet in the plane turned by R (3, 3) that looks like the image (2, p) px."""
    W = image - camera.center_px[:, None]
    t = W.mean(axis=1)
    rows = R[:2, :2, None] - (W / camera.focal_px)[:, None] * R[2, :2, None]  # (2, 2, p)
    xy = np.linalg.solve(rows.transpose(2, 0, 1), (W - t[:, None]).T[:, :, None])[:, :, 0].T
    shape = np.concatenate([xy, np.zeros((1, W.shape[1]))])
    centre = shape.mean(axis=1)
    away = R @ centre
    depth = 1 + away[2] / camera.focal_px
    return RigidMotion(shape - centre[:, None], R[None], np.array([1 / depth]), ((t + away[:2]) / depth)[None])


def first_image(W: Array, visible: Mask) -> Array:
    """Image (2, p) px of all points in the first frame, those not visible there completed from the others."""
    if visible[0].all():
        return W[0]
    known = visible.sum(axis=0) >= 2
    first = np.where(visible[0], W[0], np.nan)
    if len(W) >= 3 and visible[:, known].sum(axis=1).min() >= 4:
        A, t, S = affine_structure(W[:, :, known], visible[:, known])
        first[:, known] = np.where(visible[0, known], W[0][:, known], A[0] @ S + t[0][:, None])
    missing = np.isnan(first[0])
    centre = np.nanmean(first, axis=1)
    for i in np.flatnonzero(missing):
        seen = np.flatnonzero(visible[:, i])
        first[:, i] = W[seen[0], :, i] if seen.size else centre
    return first
