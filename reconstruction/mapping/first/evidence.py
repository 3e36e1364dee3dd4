"""What the first frames say about a rigid shape: is there turn enough, and do they agree (paper §4)."""

from dataclasses import dataclass

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.mesh import farthest_points
from reconstruction.basis.rest_shape import apart
from reconstruction.mapping.first.factorization import Factorization, factorize, view_turn_degrees

TURN_DEGREES = 10.0  # less turn than this and depth drowns in noise
RELIEF_OVER_NOISE = 3.0  # third over fourth singular value of the observations
HALVES_AGREE = 0.10  # relative difference of the shapes of even and odd frames
FEWEST_FRAMES = 2  # that show a point to judge by
FEWEST_SHARED = 4  # points of two frames that tell how one image becomes the other
JUDGING_POINTS = 150  # well-spread points are enough to decide on
STILL = 0.006  # apparent motion, beyond that of a similarity, that is not noise; of the image's RMS extent


@dataclass(frozen=True)
class Evidence:
    """What the first frames say about a rigid shape.

    Attributes:
        factorization: of the judging points.
        turn_degrees: rotation covered.
        doubt: why a rigid shape is not to be trusted; empty if it is.
    """

    factorization: Factorization
    turn_degrees: float
    doubt: str


def weigh(W: Array, visible: Mask) -> Evidence:
    """Check a rigid shape of observations (F, 2, p) px against itself.

    Raises:
        ReconstructionError: too few frames or points to factorise.
    """
    chosen = judging_points(W, visible)
    W, visible = W[:, :, chosen], visible[:, chosen]
    result = factorize(W, visible)
    moved = apparent_change(W, visible)
    turn = view_turn_degrees(result.motion.R) if moved > STILL else foreshortening_degrees(W, visible)
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
    return Evidence(result, turn, doubt)


def judging_points(W: Array, visible: Mask) -> Indices:
    """Indices of well-spread points that are seen often enough to judge the motion by."""
    share = np.where(visible.sum(axis=0) >= FEWEST_FRAMES, visible.mean(axis=0), 0.0)
    often = np.flatnonzero(share >= min(0.8, np.quantile(share[share > 0], 0.5))) if share.any() else np.arange(len(share))
    place = np.where(visible[:, None], W, 0.0).sum(axis=0) / visible.sum(axis=0).clip(1)
    return often[farthest_points(place[:, often].T, JUDGING_POINTS)]


def image_affinities(W: Array, visible: Mask) -> tuple[Array, Array]:
    """Affine maps (F, 2, 2) of one image onto each, and what they leave over, (F,) RMS over its extent.

    It is the first of those that show most points. One that shares too few with it tells nothing: the identity, and 0.
    """
    one = int(visible.sum(axis=1).argmax())
    both = (visible & visible[one]).astype(np.float64)
    both[both.sum(axis=1) < FEWEST_SHARED] = 0.0
    middle, size = W[one][:, visible[one]].mean(axis=1, keepdims=True), extent(W[one][:, visible[one]])
    first = np.where(visible[one], W[one] - middle, 0.0) / size
    B = np.concatenate([first, np.ones((1, W.shape[2]))])
    gram = np.einsum("ip,fp,jp->fij", B, both, B, optimize=True)
    known = np.where(both[:, None] > 0, W - middle, 0.0) / size
    maps = np.linalg.solve(gram + 1e-9 * np.eye(3), np.einsum("fcp,ip->fic", known, B)).transpose(0, 2, 1)
    left = (known - maps @ B) * both[:, None]
    maps[both.sum(axis=1) == 0] = np.eye(2, 3)
    return maps[:, :, :2], np.sqrt((left**2).sum(axis=(1, 2)) / both.sum(axis=1).clip(1))


def apparent_change(W: Array, visible: Mask) -> float:
    """Largest RMS motion of a frame against one that shows most, beyond a similarity, over the latter's extent.

    Turning and bending cause it.
    """
    maps, left = image_affinities(W, visible)
    values = np.linalg.svd(maps, compute_uv=False)
    stretch = (values[:, 0] - values[:, 1]) / 2
    return float(np.sqrt(stretch**2 + left**2).max())


def extent(points: Array) -> float:
    """RMS extent of points (2, n) in one coordinate."""
    return float(np.sqrt(np.var(points, axis=1).mean()))


def foreshortening_degrees(W: Array, visible: Mask) -> float:
    """Turn of a flat object that would explain the strongest foreshortening against a frame that shows most."""
    values = np.linalg.svd(image_affinities(W, visible)[0], compute_uv=False)
    return float(np.rad2deg(np.arccos(np.clip(values[:, 1] / values[:, 0], 0, 1))).max())


def halves_disagreement(W: Array, visible: Mask) -> float:
    """Relative difference of the shapes that the even and the odd frames give, the mirror image allowed."""
    try:
        a, b = (factorize(W[k::2], visible[k::2]).motion.shape for k in (0, 1))
    except ReconstructionError:
        return float("inf")
    return apart(a[None], b[None], mirrored=True)
