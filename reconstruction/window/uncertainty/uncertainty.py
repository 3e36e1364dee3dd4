"""How far off a shape may be: a standard deviation for each vertex, calibrated by what the frame's energy leaves over.

A frame's energy is E = Σ_k E_k, k the images, the lengths of edges, and the pull to rest, with Gauss-Newton Hessians H_k
and H = Σ_k H_k. Each is a sum of squares whose variance per unit weight is

    τ_k = E_k / (n_k − tr H⁻¹H_k)

with n_k independent residuals (Förstner's variance components), and an estimate that weighs them as E does has the
covariance

    C = H⁻¹ (Σ_k τ_k H_k) H⁻¹.

Neighbours' residuals are alike, since most of them is what the modes leave out: n_k is the number of residuals over the
variance of their sums in small patches, in units of that of independent ones. What the modes leave out is missing from the
vertices, too (`variances.left_out`). Where deformations are known (`energy.Pull`), τ_k is the noise they were learned with.

Where the focal length was looked for, it makes all vertices as unsure as it makes the shape (`mapping.isometric.focal`).

Neighbouring frames count for nothing, since their errors are alike, too. The rest shape is taken as exact, and so is the
side to which it bends: before an orthographic camera the mirror image may be the truth.
"""

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.constraints import ALL_ROWS
from reconstruction.basis.mesh import farthest_points
from reconstruction.basis.model import Model
from reconstruction.camera import rotation_from_quaternion
from reconstruction.state import POSE, State
from reconstruction.window.energy import Energy
from reconstruction.window.robust import robust_weights
from reconstruction.window.statistics import Statistics
from reconstruction.window.terms import HAT
from reconstruction.window.uncertainty.variances import alike, left_out, parts, variance

PATCHES_PER_MODE = 2  # of points, so that a patch is smaller than what the modes follow; of edges, which are fewer, half
RIDGE = 1e-12  # of the mean diagonal, where neither image nor prior holds a parameter


class Uncertainty:
    """Standard deviations of the vertices; one public verb.

    Args:
        model: the rest shape and its modes.
        by_focal: how far shapes may be off by the focal length, over their size.
    """

    def __init__(self, model: Model, by_focal: float = 0.0) -> None:
        self._model, self._by_focal = model, by_focal
        self._modes = len(model.basis.eigenvalues)
        places = model.B[:3].T
        self._patch = patches(places, PATCHES_PER_MODE * self._modes)
        self._nearest = np.asarray(cKDTree(places).query(places, k=2)[1], np.int64)[:, 1]

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
        size = float(np.exp(state.log_s[0]))
        residuals = np.where(visible, self._model.residuals(W, state), 0.0) / (self._model.radius_px * size)
        weights = robust_weights(residuals, visible)
        values, hessians = parts(energy, data, state)
        ridge = RIDGE * np.trace(hessians.sum(axis=0)) / hessians.shape[1]
        inverse = np.linalg.inv(hessians.sum(axis=0) + ridge * np.eye(hessians.shape[1]))
        if energy.pull is None:
            counts = (
                2 * weights.sum() / alike(weights * residuals, self._patch),
                self._independent_edges(energy, state),
                len(energy.rows) * self._modes,
            )
            taken = np.einsum("ij,kji->k", inverse, hessians)
            tau = np.array([variance(*one) for one in zip(values, counts, taken, strict=True)])
        else:
            tau = np.full(len(hessians), energy.pull.variance)
        spread, axes = np.linalg.eigh(inverse @ np.tensordot(tau, hessians, axes=1) @ inverse)
        moved = self._derivatives(energy, state) @ (axes * np.sqrt(spread.clip(0.0)))
        missing = left_out(state.Lambda[0] - energy.centre, state, residuals, weights, self._nearest)
        unit = self._model.radius if self._model.camera.perspective else self._model.radius_px * size
        return np.asarray(unit * np.sqrt((moved**2).sum(axis=(0, 2)) + missing + self._by_focal**2))

    def _independent_edges(self, energy: Energy, state: State) -> float:
        """As how many edges those whose lengths are kept count."""
        if energy.edges is None:
            return 0.0
        strain = energy.edges.strain(energy.edges.vectors(state.Lambda))
        return strain.size / alike(strain, patches(energy.edges.middle.T, PATCHES_PER_MODE * self._modes // 2))

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


def patches(places: Array, count: int) -> Indices:
    """Which of so many well-spread places each of the places (n, 3) is nearest to, (n,)."""
    return np.asarray(cKDTree(places[farthest_points(places, count)]).query(places)[1], np.int64)
