"""Bundle adjustment of a sheet: shapes that keep its lengths and are where its points were seen, both at once.

Smooth images and depths along their rays, found one after the other, are only the start: an image made smooth by itself
does not know that the sheet keeps its lengths. A shape is S = C B, B smooth functions of the place on the reference image.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dsyrk, dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf

from reconstruction.arrays import Array
from reconstruction.mapping.isometric.lengths import coupled
from reconstruction.mapping.isometric.shape_prior import ShapePrior

FUNCTIONS, FINE_FUNCTIONS = 60, 100
GIVE, MOST_GIVE = 0.002, 0.004  # what lengths of paper, and of cloth, change by, noise apart
# Of free lengths that change by the former, and in proportion to the square of what they change by, at least so much of it:
# how lengths really change is alike in neighbours and from frame to frame, no noise, and would lead them far astray.
DAMPING, LEAST = 0.1, 0.01


@dataclass(frozen=True)
class Lengths:
    """Edges of a sheet made of smooth functions.

    An edge is a line on the surface, not a chord, which gets shorter as the surface bends: its length is that of the two
    chords over its halves, and by a third of what these are longer than the one chord (Richardson).

    Attributes:
        halves: (2, n, R) the functions at the middle less those at one end, and at the other end less those at the middle.
        logs: (n,) logarithms of the lengths.
        weights: (n,) 1 for edges that keep their length, near 0 for those that do not.
        stiffness: (R,) bending energy of the functions.
        give: standard deviation of the logs.
    """

    halves: Array
    logs: Array
    weights: Array
    stiffness: Array
    give: float = GIVE

    def now(self, C: Array) -> tuple[Array, Array]:
        """Logarithms (F, n) of the lengths in shapes C (F, 3, R), and their slopes (2, F, 3, n) by the two half edges."""
        d = np.stack([C @ half.T for half in self.halves])
        chord = d.sum(axis=0)
        longer = [np.sqrt(np.maximum((e**2).sum(axis=-2, keepdims=True), 1e-300)) for e in (d, chord)]
        length = (4 * longer[0].sum(axis=0) - longer[1]) / 3
        slopes = (4 * d / longer[0] - chord / longer[1]) / (3 * length)
        return np.log(length[:, 0]), slopes


def data_normal(rays: Array, weights: Array, C: Array, B: Array) -> Array:
    """Normal matrix (F, 3R, 3R) of shapes C (F, 3, R) whose points are seen along rays (F, 2, m), third coordinate 1.

    How far a point is beside its ray, X − x Z, is linear in the shape, and 0 for the shape 0; over its depth as it is now
    that is the error in the image.

    Args:
        rays: as above.
        weights: (F, m) of squared errors in the image.
        C: the shapes.
        B: (m, R) the functions at the points.
    """
    x, y = rays[:, 0], rays[:, 1]
    weights = weights / np.maximum(C[:, 2] @ B.T, 1e-3) ** 2  # depths are about 1
    one, wx, wy, wz = ((B.T * (weights * by)[:, None]) @ B for by in (1.0, x, y, x**2 + y**2))
    none = np.zeros_like(one)
    rows = [[one, none, -wx], [none, one, -wy], [-wx, -wy, wz]]
    return np.concatenate([np.concatenate(row, axis=2) for row in rows], axis=1)


def stepped(C: Array, data: Array, lengths: Lengths, prior: ShapePrior, *, free: bool = False) -> Array:
    """Shapes C (F, 3, R) after a Gauss-Newton step towards their lengths, by the data's normal matrix and what others say.

    NaN where there is no such step. Free lengths are the mean of what they are in all F frames, and change with them. That
    couples the frames: their normal matrix is a block H_f each, less J Jᵀ/F, J (F, 3R, n) the slopes of the n lengths. With
    H_f = L_f L_fᵀ it is inverted by the matrix I − (L⁻¹J)ᵀ L⁻¹J/F of the lengths alone (Woodbury).
    """
    F, _, R = C.shape
    logs, slopes = lengths.now(C)
    off = logs - (logs.mean(axis=0) if free else lengths.logs)
    root = np.sqrt(lengths.weights) / lengths.give
    halves = [np.ascontiguousarray(half.T) for half in lengths.halves]
    held, away = prior.at(C)
    factors, step = np.empty((F, 3 * R, 3 * R)), np.full((F, 3 * R), np.nan)
    through = np.zeros((F if free else 0, 3 * R, len(root)))
    for f, along in enumerate((slopes * root).swapaxes(0, 1)):
        J = (along[0][:, None] * halves[0] + along[1][:, None] * halves[1]).reshape(3 * R, -1)
        gradient = data[f] @ C[f].ravel() + J @ (root * off[f]) + held[f] @ away[f]
        # One triangle of the symmetric matrix is enough for Cholesky's factors. LAPACK counts along columns.
        factors[f], failed = dpotrf(dsyrk(1.0, J.T, 1.0, data[f].T + held[f], trans=1), overwrite_a=1)
        if failed:
            continue
        step[f] = dtrsv(factors[f], gradient, trans=1)
        if free:
            through[f] = dtrsm(1.0, factors[f], J, trans_a=1)
    if free:
        step += coupled(through, np.nan_to_num(step), F * (1 + damping(off, lengths.weights)))
    step = np.stack([dtrsv(factor, one) for factor, one in zip(factors, step, strict=True)])
    return C - step.reshape(C.shape)


def damping(off: Array, weights: Array) -> float:
    """Of free lengths that are so far off their mean (F, n), weighted (n,)."""
    squared = float(np.median(off**2 @ weights)) / max(float(weights.sum()), 1e-12)
    return DAMPING * max(squared / GIVE**2, LEAST)


def places_moved(C: Array, rays: Array, weights: Array, B: Array, slopes: Array) -> Array:
    """How far (2, p) the places of points on the reference image are from where all frames see them.

    Args:
        C: (F, 3, R) shapes.
        rays: (F, 2, p).
        weights: (F, p) 0 where not seen.
        B: (p, R) the functions at the points.
        slopes: (p, R, 2) their derivatives by the place.
    """
    X = C @ B.T
    seen, depth = X[:, :2] / X[:, 2:], X[:, 2:]
    along = [C @ slope.T for slope in slopes.transpose(2, 0, 1)]
    J = np.stack([(to[:, :2] - seen * to[:, 2:]) / depth for to in along])  # (2, F, 2, p)
    weighted = J * weights[:, None]
    off = np.where(weights[:, None] > 0, rays - seen, 0.0)
    H = np.array([[(one * other).sum(axis=(0, 1)) for other in J] for one in weighted]).transpose(2, 0, 1)
    g = (weighted * off).sum(axis=(1, 2)).T
    H += np.trace(H, axis1=1, axis2=2).mean() / (2 * len(C)) * np.eye(2)  # as one frame more that sees it in place
    return np.asarray(np.linalg.solve(H, g[:, :, None])[:, :, 0].T)
