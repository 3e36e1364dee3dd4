"""A rest shape that keeps improving: frames that have left the window go on to say where the surface rests (paper §4).

It moves within the span of its modes, S̄ + ΦΛ̄Υ, so that modes, model and S = S̄ + ΦΛΥ stay what they are and only the
coefficients Λ̄ of the surface at rest are estimated. A frame's data term is quadratic in Λ, so frames with settled pose and
deformation add up to one normal system for a shift that they all share; no point is touched again.
"""

import numpy as np
from numpy.typing import NDArray

from reconstruction.state import POSE
from reconstruction.window.energy import Normal

Array = NDArray[np.float64]

PULL = 0.4  # towards the first rest shape; a frame in which all points are seen weighs about 1
KEPT = 0.98  # of what is known, frame by frame: some 50 frames count
FEWEST = 5  # frames; fewer turn too little to tell rest from pose


class Refinement:
    """Where the surface rests, by the frames so far; one public verb.

    Args:
        modes: r.

    Attributes:
        rest: (3, r) Λ̄', zero for the rest shape of the first frames.
    """

    def __init__(self, modes: int) -> None:
        self.rest: Array = np.zeros((3, modes))
        self._hessian, self._right = np.zeros((3 * modes, 3 * modes)), np.zeros(3 * modes)
        self._frames = 0

    def take(self, seen: Normal) -> None:
        """Learn from the data term of one settled frame (n = 1), which was deformed about the rest as it is now."""
        hessian, gradient = seen.diagonal[0, POSE:, POSE:], seen.gradient[0, POSE:]
        self._hessian = KEPT * self._hessian + hessian
        self._right = KEPT * self._right + hessian @ self.rest.ravel() - gradient
        self._frames += 1
        if self._frames >= FEWEST:
            pulled = self._hessian + PULL * np.eye(self.rest.size)
            self.rest = np.asarray(np.linalg.solve(pulled, self._right)).reshape(self.rest.shape)
