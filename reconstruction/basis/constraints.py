"""Constraints on the deformation (paper §3.4): rows of Λ that stay zero, and surfaces that keep their lengths."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array
from reconstruction.settings import Deformation

ALL_ROWS = (0, 1, 2)
ROWS: dict[str, tuple[int, ...]] = {"bending": (2,), "stretching": (0, 1), "general": ALL_ROWS, "inextensible": ALL_ROWS}
GIVE = 1e-2  # pull of rows α and β to rest, against the mean squared strain: what edges leave open stays small


def fitting(deformation: Deformation, *, flat: bool) -> Deformation:
    """The constraint that `auto` stands for: a sheet keeps its lengths, a solid may deform in any way."""
    if deformation != "auto":
        return deformation
    return "inextensible" if flat else "general"


@dataclass(frozen=True)
class CoarseEdges:
    """Edges of a coarse mesh whose lengths the surface keeps; smooth modes cannot stretch between its vertices.

    Attributes:
        rest: (3, e) end minus start in the rest shape S̄'.
        modes: (r, e) the same of Υ'.
        length: (e,) rest lengths.
        middle: (3, e) their midpoints in S̄'.
    """

    rest: Array
    modes: Array
    length: Array
    middle: Array

    def about(self, centre: Array) -> "CoarseEdges":
        """The same edges with the lengths of a rest shape refined to Λ̄' (3, r)."""
        return replace(self, length=np.linalg.norm(self.vectors(centre), axis=0))

    def vectors(self, Lambda: Array) -> Array:
        """Edges (..., 3, e) of the shapes deformed by Λ' (..., 3, r)."""
        return self.rest + Lambda @ self.modes

    def strain(self, vectors: Array) -> Array:
        """ρ_e = (‖d_e‖² − l_e²)/(2 l_e) (n, e): the change of length to first order, without a square root."""
        return ((vectors**2).sum(axis=1) - self.length**2) / (2 * self.length)


class Bending:
    """Rows α and β of Λ' as functions of row τ, for a sheet that bends without stretching.

    Γ_τ changes an edge d̄ by δ_τ and makes it longer by (d̄_τ δ_τ + δ_τ²/2) over its length. A sheet of paper draws in
    instead: Γ_α and Γ_β change the length by d̄_α δ_α + d̄_β δ_β over it, which is linear in them. So the rows that cancel
    the excess best, by least squares over all edges, are a fixed matrix times the excess. Only Γ_τ is estimated.

    Args:
        edges: of the coarse mesh.
        stiffness: (r,) how hard each mode is held, relative to the others.
        centre: (3, r) Λ̄' of the rest shape.
    """

    def __init__(self, edges: CoarseEdges, stiffness: Array, centre: Array | None = None) -> None:
        self._edges, self._stiffness = edges, stiffness
        self._centre = np.zeros((3, len(stiffness))) if centre is None else centre
        self._rest, length = edges.vectors(self._centre), edges.about(self._centre).length
        count = len(length)
        stretch = (self._rest[:2, None] * edges.modes).reshape(-1, count) / length  # (2r, e) of unit Γ_α, Γ_β
        held = np.diag(GIVE * np.tile(stiffness, 2))
        self._drawn = np.linalg.solve(stretch @ stretch.T / count + held, stretch / length / count)

    def about(self, centre: Array) -> "Bending":
        """The same sheet with the rest shape refined to Λ̄' (3, r)."""
        return Bending(self._edges, self._stiffness, centre)

    def completed(self, Lambda: Array) -> Array:
        """Λ' (n, 3, r) with rows α and β computed from row τ."""
        rise = (Lambda[:, 2] - self._centre[2]) @ self._edges.modes
        excess = rise * (self._rest[2] + 0.5 * rise)
        completed = Lambda.copy()
        completed[:, :2] = self._centre[:2] - (excess @ self._drawn.T).reshape(len(Lambda), 2, -1)
        return completed

    def slope(self, Lambda: Array) -> Array:
        """Derivative (n, 3r, r) of the completed Λ', row by row, with respect to row τ."""
        rise = (Lambda[:, 2] - self._centre[2]) @ self._edges.modes
        followed = -(self._drawn * (self._rest[2] + rise)[:, None]) @ self._edges.modes.T
        own = np.broadcast_to(np.eye(Lambda.shape[2]), (len(Lambda), *2 * (Lambda.shape[2],)))
        return np.concatenate([followed, own], axis=1)
