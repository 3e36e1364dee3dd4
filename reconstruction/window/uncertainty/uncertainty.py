"""How far off a shape may be: a standard deviation for each vertex, calibrated by what earlier frames leave over.

A frame's energy is E = Σ_k E_k, k the images, the lengths of edges, and the pull to rest, with Gauss-Newton Hessians H_k
and H = Σ_k H_k. Each is a sum of squares whose variance per unit weight is

    τ_k = E_k / (n_k − tr H⁻¹H_k)

with n_k independent terms (Förstner's variance components), and an estimate that weighs them as E does has the covariance

    C = H⁻¹ (Σ_k τ_k H_k) H⁻¹.

Neighbours' residuals are alike, since most of them is what the modes leave out: n_k is the number of terms over the
variance of their sums in small patches, in units of that of independent ones. Besides, a vertex has what the modes leave
out itself: the part of its residuals that the nearest vertex shares. In depth that is as much more as the last modes are
higher there.

Neighbouring frames count for nothing: their errors are alike, too. The rest shape is taken as exact.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.constraints import ALL_ROWS
from reconstruction.basis.mesh import farthest_points
from reconstruction.basis.model import Model
from reconstruction.camera import rotation_from_quaternion
from reconstruction.state import POSE, State
from reconstruction.window.energy import Energy
from reconstruction.window.normal import Normal
from reconstruction.window.robust import robust_weights
from reconstruction.window.statistics import Statistics
from reconstruction.window.terms import HAT, linearise
from reconstruction.window.uncertainty.variances import Variances

PATCHES_PER_MODE = 2  # of points, so that a patch is smaller than what the modes follow; of edges, which are fewer, half
LAST_MODES = 0.3  # of the modes, that tell what those left out are like
RIDGE = 1e-12  # of the mean diagonal, where neither image nor prior holds a parameter


class Uncertainty:
    """Standard deviations of the vertices, frame by frame; one public verb.

    Args:
        model: the rest shape and its modes.
    """

    def __init__(self, model: Model) -> None:
        self._model, self._variances = model, Variances()
        places = model.B[:3].T
        self._modes = len(model.basis.eigenvalues)
        self._patch = patches(places, PATCHES_PER_MODE * self._modes)
        self._nearest = np.asarray(cKDTree(places).query(places, k=2)[1], np.int64)[:, 1]
        self._edge_patch: Indices | None = None

    def sigma(self, energy: Energy, data: Statistics, state: State, W: Array, visible: Mask) -> Array:
        """Standard deviation (p,) of each vertex's distance from its true place, in units of the shape.

        As for e3d, a shift and a turn of the whole do not count.

        Args:
            energy: what was minimised.
            data: the frame's data term.
            state: the frame's pose and Λ' (n = 1).
            W: (2, p) px; anything where not visible.
            visible: (p,).
        """
        hessians = self._weigh(energy, data, state, W, visible)
        inverse = inverted(hessians.sum(axis=0))
        meat = np.tensordot(self._variances.per_weight(), hessians, axes=1)
        values, vectors = np.linalg.eigh(inverse @ meat @ inverse)
        J = self._derivatives(energy, state) @ (vectors * np.sqrt(np.maximum(values, 0.0)))
        variance = (J**2).sum(axis=(0, 2)) + self._variances.left_out()
        unit = self._model.radius if self._model.camera.perspective else self._model.radius_px * np.exp(state.log_s[0])
        return np.asarray(unit * np.sqrt(variance))

    def _weigh(self, energy: Energy, data: Statistics, state: State, W: Array, visible: Mask) -> Array:
        """Hessians (3, d, d) of the terms at a frame, which is added to the variances."""
        terms = normals(energy, data, state)
        hessians = np.stack([term.diagonal[0] for term in terms])
        inverse = inverted(hessians.sum(axis=0))
        variances = self._variances
        variances.frames += 1
        variances.energy += [term.value[0] for term in terms]
        variances.taken += np.einsum("ij,kji->k", inverse, hessians)
        left = np.where(visible, self._model.residuals(W, state), 0.0) / (self._model.radius_px * np.exp(state.log_s[0]))
        weights = robust_weights(left, visible)
        self._compare(0, weights * left, self._patch)
        variances.count += [2 * weights.sum(), 0, len(energy.rows) * self._modes]
        if energy.edges is not None:
            if self._edge_patch is None:
                self._edge_patch = patches(energy.edges.middle.T, PATCHES_PER_MODE * self._modes // 2)
            strain = energy.edges.strain(energy.edges.vectors(state.Lambda))
            self._compare(1, strain, self._edge_patch)
            variances.count[1] += strain.size
        self._compare_nearest(left, weights)
        variances.misfit += float((weights * left**2).sum() / max(2 * weights.sum(), 1e-300))
        deformation = state.Lambda[0] - energy.centre
        last = (deformation[:, -max(1, round(LAST_MODES * self._modes)) :] ** 2).sum(axis=1)
        variances.last += last
        variances.shown += float((rotation_from_quaternion(state.q[0])[:2] ** 2).sum(axis=0) @ last) / 2
        return hessians

    def _compare(self, term: int, residuals: Array, patch: Indices) -> None:
        """Residuals (k, n) of points or edges: squared sums in patches (n,), and sums of squares."""
        sums = np.stack([np.bincount(patch, row) for row in residuals])
        self._variances.patches[term] += (sums**2).sum()
        self._variances.squares[term] += (residuals**2).sum()

    def _compare_nearest(self, left: Array, weights: Array) -> None:
        both = weights * weights[self._nearest]
        other = left[:, self._nearest]
        self._variances.shared += float((both * left * other).sum())
        self._variances.paired += float((both * (left**2 + other**2)).sum()) / 2

    def _derivatives(self, energy: Energy, state: State) -> Array:
        """Derivatives (3, p, d) of the vertices' places by the frame's parameters, without shift and turn of the whole."""
        B, r = self._model.B, self._modes
        R = rotation_from_quaternion(state.q[0])
        placed = B[:3] + state.Lambda[0] @ B[3:-1]
        rows = energy.rows if energy.bending is None else ALL_ROWS
        J = np.zeros((3, B.shape[1], POSE + len(rows) * r))
        J[:, :, :3] = np.moveaxis(R @ (HAT @ placed), 0, -1)
        if energy.free_scale and not self._model.camera.perspective:  # else it only moves the whole
            J[:, :, 5] = R @ placed
        for k, row in enumerate(rows):
            J[:, :, POSE + k * r : POSE + (k + 1) * r] = R[:, row, None, None] * B[3:-1].T
        if energy.bending is not None:
            J = np.concatenate([J[:, :, :POSE], J[:, :, POSE:] @ energy.bending.slope(state.Lambda)[0]], axis=2)
        J -= J.mean(axis=1, keepdims=True)
        flat = J.reshape(-1, J.shape[2])
        turns = np.linalg.qr(flat[:, :3])[0]
        return np.asarray((flat - turns @ (turns.T @ flat)).reshape(J.shape))


def normals(energy: Energy, data: Statistics, state: State) -> tuple[Normal, Normal, Normal]:
    """Value and Hessian of images, edges, and what pulls to rest, without what couples frames."""
    images = replace(energy, rest=0.0, edges=None, residuals=())
    parts = [linearise(part, data, state, None) for part in (images, replace(images, edges=energy.edges), energy)]
    return parts[0], without(parts[1], parts[0]), without(parts[2], parts[1])


def without(normal: Normal, part: Normal) -> Normal:
    """What a part leaves of normal equations."""
    return Normal(
        normal.value - part.value, normal.gradient - part.gradient, normal.diagonal - part.diagonal, normal.coupling
    )


def inverted(hessian: Array) -> Array:
    """Inverse of a positive semi-definite matrix, directions that nothing holds damped."""
    ridge = RIDGE * np.trace(hessian) / len(hessian)
    return np.asarray(np.linalg.inv(hessian + ridge * np.eye(len(hessian))))


def patches(places: Array, count: int) -> Indices:
    """Which of so many well-spread places each of the places (n, 3) is nearest to, (n,)."""
    return np.asarray(cKDTree(places[farthest_points(places, count)]).query(places)[1], np.int64)
