"""Variance components: how noisy images, edge lengths and the pull to rest have been so far."""

from dataclasses import dataclass, field

import numpy as np

from reconstruction.arrays import Array

LEAST_FREE = 0.15  # of the terms: no fewer are what the parameters do not take up


@dataclass
class Variances:
    """Sums over the frames so far.

    Attributes:
        energy, taken: of each term, E_k and tr H⁻¹H_k.
        count: of each term, the number of its residuals.
        patches, squares: of points and of edges, squared sums in patches and sums of squares.
        shared, paired: products of nearest vertices' residuals, and their mean squares.
        last: (3,) mean squares of the last modes, by row of Λ'.
        shown: how much of that images show, in one coordinate.
        misfit: mean square of a residual, in one coordinate.
        frames: so many.
    """

    energy: Array = field(default_factory=lambda: np.zeros(3))
    taken: Array = field(default_factory=lambda: np.zeros(3))
    count: Array = field(default_factory=lambda: np.zeros(3))
    patches: Array = field(default_factory=lambda: np.zeros(2))
    squares: Array = field(default_factory=lambda: np.zeros(2))
    shared: float = 0.0
    paired: float = 0.0
    last: Array = field(default_factory=lambda: np.zeros(3))
    shown: float = 0.0
    misfit: float = 0.0
    frames: int = 0

    def per_weight(self) -> Array:
        """τ (3,) of images, edges and rest."""
        alike = np.append(self.patches / np.where(self.squares > 0, self.squares, 1.0), 1.0)
        count = self.count / np.maximum(alike, 1.0)
        return self.energy / np.maximum(np.maximum(count - self.taken, LEAST_FREE * count), 1e-300)

    def left_out(self) -> float:
        """Variance of a vertex's place, of all three coordinates together, by what the modes leave out.

        Never more than the last modes have themselves.
        """
        seen = self.misfit / self.frames * float(np.clip(self.shared / max(self.paired, 1e-300), 0.0, 1.0))
        last = float(self.last.sum())
        return min(seen * last / self.shown, last / self.frames) if self.shown > 0 else 0.0
