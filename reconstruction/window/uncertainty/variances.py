"""How noisy a frame is: images, edge lengths and the pull to rest, and what the modes leave out."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Indices
from reconstruction.camera import rotation_from_quaternion
from reconstruction.state import State
from reconstruction.window.energy import Energy
from reconstruction.window.statistics import Statistics
from reconstruction.window.terms import linearise

LEAST_FREE = 0.15  # of the residuals: no fewer are what the parameters do not take up
LAST_MODES = 0.3  # of the modes, that tell what those left out are like


def parts(energy: Energy, data: Statistics, state: State) -> tuple[Array, Array]:
    """Values (3,) and Hessians (3, d, d) of images, edges and pull to rest in a frame (n = 1), by itself."""
    images = replace(energy, rest=0.0, edges=None, pull=None, residuals=())
    sums = [linearise(part, data, state, None) for part in (images, replace(images, edges=energy.edges), energy)]
    values, hessians = np.array([s.value[0] for s in sums]), np.stack([s.diagonal[0] for s in sums])
    return np.diff(values, prepend=0.0), np.diff(hessians, axis=0, prepend=0.0)


def variance(value: float, count: float, taken: float) -> float:
    """Variance per unit weight of a sum of so many squares, of which the parameters have taken up some."""
    return value / max(count - taken, LEAST_FREE * count, 1e-300)


def alike(residuals: Array, patch: Indices) -> float:
    """How many residuals (k, n) count as one: the variance of their sums in patches (n,) over that of independent ones."""
    sums = np.stack([np.bincount(patch, row) for row in residuals])
    return max(float((sums**2).sum()) / max(float((residuals**2).sum()), 1e-300), 1.0)


def left_out(deformation: Array, state: State, residuals: Array, weights: Array, nearest: Indices) -> float:
    """Variance of a vertex's place, of its three coordinates together, by what the modes leave out.

    It is the part of the residuals that nearest vertices share, and in depth as much more as the last modes are higher
    there; never more than the last modes have themselves.

    Args:
        deformation: (3, r) Λ' about the rest shape.
        state: the frame (n = 1).
        residuals: (2, p) over the shape's size in the image.
        weights: (p,).
        nearest: (p,) the nearest vertex of each.
    """
    both, other = weights * weights[nearest], residuals[:, nearest]
    paired = float((both * (residuals**2 + other**2)).sum()) / 2
    shared = float((both * residuals * other).sum()) / max(paired, 1e-300)
    misfit = float((weights * residuals**2).sum()) / max(2 * float(weights.sum()), 1e-300)
    rows = (deformation[:, -max(1, round(LAST_MODES * deformation.shape[1])) :] ** 2).sum(axis=1)
    shown = float((rotation_from_quaternion(state.q[0])[:2] ** 2).sum(axis=0) @ rows) / 2  # in one coordinate of the image
    if shown <= 0:
        return 0.0
    return min(max(shared, 0.0) * misfit / shown, 1.0) * float(rows.sum())
