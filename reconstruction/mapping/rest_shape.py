"""The rest shape S̄ from the first frames: rigid, a flat sheet, or neither, decided by the evidence (paper §4)."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reconstruction import ReconstructionError
from reconstruction.basis.mesh import farthest_points
from reconstruction.basis.modes import is_flat
from reconstruction.camera import Camera
from reconstruction.mapping.factorization import Factorization, affine_structure, factorize, view_turn_degrees
from reconstruction.mapping.rigid import RigidMotion, bundle_adjust, follow
from reconstruction.mapping.sheet import best_tilted, sheet

Array = NDArray[np.float64]
Visibility = NDArray[np.bool_]
Kind = Literal["rigid", "plane", "mesh", "truth"]

TURN_DEGREES = 10.0  # less turn than this and depth drowns in noise
RELIEF_OVER_NOISE = 3.0  # third over fourth singular value of the observations
HALVES_AGREE = 0.10  # relative difference of the shapes of even and odd frames
JUDGING_POINTS = 150  # well-spread points are enough to decide on
TILT_GAIN = 0.7  # a tilt is believed when it lowers the reprojection error below this share of the frontal one's
SHARP = 2.0  # times worse that a clearly other tilt fits, where the tilt shows even in a smaller turn
BENT_PX = 1.0  # reprojection error above which a sheet is not flat in all frames
FEWEST_FLAT = 10  # frames that tell a tilt
FAR = 3.0  # times the median distance from the middle, beyond which a point's depth is not believed
STILL_PX = 0.5  # apparent motion, beyond that of a similarity, that is not noise


@dataclass(frozen=True)
class RestShape:
    """S̄ with how it was seen in the frames it came from.

    Attributes:
        kind: where it came from.
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


@dataclass(frozen=True)
class Evidence:
    """What the first frames say about a rigid shape.

    Attributes:
        factorization: of the judging points.
        turn_degrees: rotation covered.
        relief: third over fourth singular value.
        disagreement: relative difference of the shapes of even and odd frames.
        doubt: why a rigid shape is not to be trusted; empty if it is.
    """

    factorization: Factorization
    turn_degrees: float
    relief: float
    disagreement: float
    doubt: str


def weigh(W: Array, visible: Visibility) -> Evidence:
    """Check a rigid shape of observations (F, 2, p) px against itself.

    Raises:
        ReconstructionError: too few frames or points to factorise.
    """
    chosen = judging_points(W, visible)
    W, visible = W[:, :, chosen], visible[:, chosen]
    result = factorize(W, visible)
    moved = apparent_change(W, visible)
    turn = view_turn_degrees(result.motion.R) if moved > STILL_PX else foreshortening_degrees(W, visible)
    relief = float(result.singular_values[2] / max(result.singular_values[3], 1e-12))
    disagreement = halves_disagreement(W, visible)
    doubt = ""
    if turn < TURN_DEGREES:
        doubt = f"the object turned {turn:.1f}° in {len(W)} frames, about {TURN_DEGREES:.0f}° are needed"
    elif result.metric_condition <= 0:
        doubt = f"no rigid shape explains the motion in {len(W)} frames: the object deforms, or hardly turns"
    elif relief < RELIEF_OVER_NOISE:
        doubt = f"the object shows no relief above the noise in {len(W)} frames (ratio {relief:.1f})"
    elif disagreement > HALVES_AGREE:
        doubt = f"even and odd frames of the first {len(W)} give shapes that differ by {disagreement:.0%}"
    return Evidence(result, turn, relief, disagreement, doubt)


def rigid(W: Array, visible: Visibility, camera: Camera) -> RestShape:
    """S̄ by factorisation and rigid bundle adjustment of observations (F, 2, p) px (Tomasi & Kanade 1992).

    Raises:
        ReconstructionError: the object turned too little for its depth to show, or too few frames or points.
    """
    chosen = judging_points(W, visible)
    turned = foreshortening_degrees(W[:, :, chosen], visible[:, chosen])
    if apparent_change(W[:, :, chosen], visible[:, chosen]) <= STILL_PX:
        raise ReconstructionError(
            f"cannot recover a rest shape: the object turned {turned:.1f}° in {len(W)} frames, about "
            f"{TURN_DEGREES:.0f}° are needed",
            "rest_shape",
        )
    start = factorize_often_seen(W, visible)
    start = replace(start, t=start.t - camera.center_px)
    starts = [start, start.mirrored()] if camera.perspective else [start]
    motion, rms = min((bundle_adjust(W, visible, s, camera) for s in starts), key=lambda found: found[1])
    motion = motion.in_first_frame()
    turn = view_turn_degrees(motion.R)
    note = f"rigid shape from {len(W)} frames, turned {turn:.0f}°, reprojection error {rms:.2f} px"
    return RestShape("rigid", motion, note)


def factorize_often_seen(W: Array, visible: Visibility) -> RigidMotion:
    """Factorise the points seen in enough frames; the others start where they are seen, as deep as those beside them.

    So do points that come out far from all others.

    Raises:
        ReconstructionError: too few frames or points.
    """
    often = visible.sum(axis=0) >= max(3, 0.2 * len(W))
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
    for i in np.flatnonzero(~often & visible.any(axis=0)):
        f = int(visible[:, i].argmax())
        placed = motion.s[f] * motion.R[f] @ motion.shape
        place = W[f, :, i] - motion.t[f]
        beside = np.argsort(((placed[:2].T - place) ** 2).sum(axis=1))[:4]
        shape[:, i] = motion.R[f].T @ np.append(place, placed[2, beside].mean()) / motion.s[f]
    return replace(motion, shape=shape)


def plane(W: Array, visible: Visibility, camera: Camera) -> RestShape:
    """A flat sheet: tilted as the first frames say, frontal where they do not say.

    Raises:
        ReconstructionError: fewer than 4 points visible in a frame.
    """
    if visible.sum(axis=1).min() < 4:
        raise ReconstructionError("cannot recover a rest shape: fewer than 4 points are visible")
    first = first_image(W, visible)
    frontal = sheet(first, np.eye(3), camera)
    chosen = judging_points(W, visible)
    if apparent_change(W[:, :, chosen], visible[:, chosen]) <= STILL_PX or len(W) < 3:
        return RestShape("plane", frontal, "flat sheet facing the camera: the first frames show no turn")
    frames = np.unique(np.linspace(0, len(W) - 1, 16).astype(int))
    W_few, visible_few = W[frames][:, :, chosen], visible[frames][:, chosen]
    (ahead,) = follow(W_few, visible_few, [sheet(first[:, chosen], np.eye(3), camera)], camera)
    level = bundle_adjust(W_few, visible_few, ahead, camera, sweeps=1)
    start, sharpness = best_tilted(first[:, chosen], W_few, visible_few, camera)
    tilted = bundle_adjust(W_few, visible_few, start, camera, flat=True, sweeps=15)
    turn = view_turn_degrees(tilted[0].R)
    if tilted[1] > TILT_GAIN * level[1] or (turn < TURN_DEGREES and sharpness < SHARP):
        if tilted[1] > BENT_PX and len(W) >= 2 * FEWEST_FLAT:  # it bends meanwhile: judge by the frames before
            return plane(W[: len(W) // 2], visible[: len(W) // 2], camera)
        note = f"flat sheet facing the camera: its tilt does not show in {len(W)} frames"
        return RestShape("plane", frontal, note)
    whole = sheet(first, tilted[0].R[0], camera)
    tilt = np.rad2deg(np.arccos(np.clip(abs(whole.R[0, 2, 2]), 0, 1)))
    note = f"flat sheet tilted {tilt:.0f}° in the first frame, turned {turn:.0f}°, reprojection error {tilted[1]:.2f} px"
    return RestShape("plane", whole.in_first_frame(), note)


def given(shape: Array, kind: Kind, note: str) -> RestShape:
    """A rest shape (3, p) from elsewhere: a mesh file, or the first true shape."""
    shape = shape - shape.mean(axis=1, keepdims=True)
    motion = RigidMotion(shape, np.eye(3)[None], np.ones(1), np.zeros((1, 2)))
    return RestShape(kind, motion, note)


def first_image(W: Array, visible: Visibility) -> Array:
    """Image (2, p) px of all points in the first frame, those not visible there completed from the others."""
    if visible[0].all():
        return np.asarray(W[0])
    known = visible.sum(axis=0) >= 2
    first = np.where(visible[0], W[0], np.nan)
    if len(W) >= 3 and known.sum() >= 4:
        A, t, S = affine_structure(W[:, :, known], visible[:, known])
        first[:, known] = np.where(visible[0, known], W[0][:, known], A[0] @ S + t[0][:, None])
    missing = np.isnan(first[0])
    centre = np.nanmean(first, axis=1)
    for i in np.flatnonzero(missing):
        seen = np.flatnonzero(visible[:, i])
        first[:, i] = W[seen[0], :, i] if seen.size else centre
    return first


def judging_points(W: Array, visible: Visibility) -> NDArray[np.int64]:
    """Indices of well-spread points that are seen often enough to judge the motion by."""
    often = np.flatnonzero(visible.mean(axis=0) >= min(0.8, np.quantile(visible.mean(axis=0), 0.5)))
    place = np.where(visible[:, None], W, 0.0).sum(axis=0) / visible.sum(axis=0).clip(1)
    return often[farthest_points(place[:, often].T, JUDGING_POINTS)]


def image_affinities(W: Array, visible: Visibility) -> tuple[Array, Array]:
    """Affine maps (F, 2, 2) of the first image onto each, and what they leave over, (F,) RMS px."""
    both = (visible & visible[0]).astype(np.float64)
    first = np.where(visible[0], W[0], 0.0)
    B = np.concatenate([first, np.ones((1, W.shape[2]))])
    gram = np.einsum("ip,fp,jp->fij", B, both, B, optimize=True)
    known = np.where(both[:, None] > 0, W, 0.0)
    maps = np.linalg.solve(gram + 1e-9 * np.eye(3), np.einsum("fcp,ip->fic", known, B)).transpose(0, 2, 1)
    left = (known - maps @ B) * both[:, None]
    return maps[:, :, :2], np.sqrt((left**2).sum(axis=(1, 2)) / both.sum(axis=1).clip(1))


def apparent_change(W: Array, visible: Visibility) -> float:
    """Largest RMS motion in pixels of a frame against the first beyond a similarity: what turning or bending causes."""
    maps, left = image_affinities(W, visible)
    size = float(np.sqrt(np.var(np.where(visible[0], W[0], np.nan)[:, visible[0]], axis=1).sum() / 2))
    values = np.linalg.svd(maps, compute_uv=False)
    stretch = (values[:, 0] - values[:, 1]) / 2 * size
    return float(np.sqrt(stretch**2 + left**2).max())


def foreshortening_degrees(W: Array, visible: Visibility) -> float:
    """Turn of a flat object that would explain the strongest foreshortening against the first frame."""
    values = np.linalg.svd(image_affinities(W, visible)[0], compute_uv=False)
    return float(np.rad2deg(np.arccos(np.clip(values[:, 1] / values[:, 0], 0, 1))).max())


def halves_disagreement(W: Array, visible: Visibility) -> float:
    """Relative difference of the shapes that the even and the odd frames give, the mirror image allowed."""
    try:
        a, b = (factorize(W[k::2], visible[k::2]).motion.shape for k in (0, 1))
    except ReconstructionError:
        return float("inf")
    return min(shape_difference(a, b), shape_difference(a, np.diag([1.0, 1.0, -1.0]) @ b))


def shape_difference(a: Array, b: Array) -> float:
    """‖sRb − a‖/‖a‖ of centred shapes (3, p) with the best rotation and scale."""
    U, values, Vt = np.linalg.svd(a @ b.T)
    values[2] *= np.sign(np.linalg.det(U @ Vt))
    return float(np.sqrt(max(0.0, 1 - values.sum() ** 2 / ((a**2).sum() * (b**2).sum()))))
