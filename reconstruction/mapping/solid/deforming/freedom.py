"""How many modes a solid needs: more than usual while those predict points of the keyframes that they are not fitted to."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modal_basis import principal_axes
from reconstruction.basis.modes import modal_basis
from reconstruction.mapping.keyframes import KEYFRAMES, thinned
from reconstruction.mapping.solid.bundle import seen_by
from reconstruction.mapping.solid.solid import Solid
from reconstruction.settings import MORE_MODES, MOST_MODES, USUAL_MODES

COMPARED = 0.8  # of the points: no more modes can be compared
BETTER = 0.97  # times what half as many modes leave over: less than that is worth the time of more


def modes_held(W: Array, visible: Mask, solid: Solid, most: int = MOST_MODES) -> int:
    """Number of modes for a solid.

    What its rigid shape leaves over in each keyframe is fitted by the modes; by generalised cross validation, more of them
    always explain more, but only where there is a deformation do they predict more. Medians, against gross errors. A video
    of fewer frames than there may be keyframes has the usual number: what deforms there is seen from too few sides for its
    depth, and more modes guess more of it.

    Args:
        W: (K, 2, p) px; anything where not visible.
        visible: (K, p).
        solid: the rigid shape posed in the keyframes.
        most: that there is time for.
    """
    some = thinned(W.shape[2])
    W, visible, motion = W[:, :, some], visible[:, some], replace(solid.motion, shape=solid.shape[:, some])
    p = len(some)
    held = [USUAL_MODES, *(count for count in (MORE_MODES, MOST_MODES) if count <= most)]
    counts = np.minimum(held, int(COMPARED * p))
    if counts[1] <= USUAL_MODES or len(W) < KEYFRAMES:
        return USUAL_MODES
    shape = motion.shape
    mesh = triangulate((principal_axes(shape).T @ shape)[:2].T)
    modes = modal_basis(shape, mesh, counts[-1], "jensen-shannon").Upsilon
    functions = np.concatenate([np.full((1, p), p**-0.5), modes])
    left = W - seen_by(solid.camera, motion)
    by = [left_over(left, visible, functions[: count + 1]) for count in counts]
    better = [twice < BETTER * once for once, twice in pairwise(by)]
    return held[[*better, False].index(False)]


def left_over(residuals: Array, visible: Mask, functions: Array) -> float:
    """Usual length of residuals (K, 2, p) off functions (n, p) fitted to them, over the share of freedom that is left."""
    lengths, free = [], []
    for off, seen in zip(residuals, visible, strict=True):
        if seen.sum() > len(functions):
            basis = np.linalg.qr(functions[:, seen].T)[0]
            lengths.append(np.linalg.norm(off[:, seen] - (off[:, seen] @ basis) @ basis.T, axis=0))
            free.append(1 - len(functions) / seen.sum())
    return float(np.median(np.concatenate(lengths)) / np.mean(free)) if lengths else np.inf
