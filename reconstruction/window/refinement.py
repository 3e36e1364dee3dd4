"""Refinement of the rest shape by the frames that have left the window (paper §4).

It moves within the span of its modes, S̄ + ΦΛ̄Υ, so that modes, model and S = S̄ + ΦΛΥ stay the same and only the coefficients
Λ̄ of the rest shape are estimated. A frame's data term is quadratic in Λ, so with pose and deformation fixed all frames add
up to one linear system for a shift that they share; the points are not needed again.
"""

import numpy as np

from reconstruction.arrays import Array
from reconstruction.state import POSE
from reconstruction.window.normal import Normal

PULL = 0.4  # towards the first rest shape; a frame in which all points are seen weighs about 1
KEPT = 0.98  # of what is known, frame by frame: some 50 frames count
FEWEST = 5  # frames; fewer turn too little to tell rest from pose


class Refinement:
    """The refined rest shape; one public verb.

    Args:
        modes: r.

    Attributes:
        rest: (3, r) Λ̄', zero for the rest shape of the first frames.
    """

    def __init__(self, modes: int) -> None:
        self.rest: Array = np.zeros((3, modes))
        self._hessian, self._right = np.zeros((3 * modes, 3 * modes)), np.zeros(3 * modes)
        self._frames = 0

    def add(self, data: Normal) -> None:
        """Add the data term of one frame (n = 1), linearised about its final state; `rest` is estimated anew."""
        hessian, gradient = data.diagonal[0, POSE:, POSE:], data.gradient[0, POSE:]
        self._hessian = KEPT * self._hessian + hessian
        self._right = KEPT * self._right + hessian @ self.rest.ravel() - gradient
        self._frames += 1
        if self._frames >= FEWEST:
            pulled = self._hessian + PULL * np.eye(self.rest.size)
            self.rest = np.asarray(np.linalg.solve(pulled, self._right)).reshape(self.rest.shape)
