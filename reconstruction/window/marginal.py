"""What the frames that have left the window leave behind: where the next is tied to, and how firmly (paper §5).

An image says little about depth, but a deformation that lasts while the object turns shows more with every frame. So what a
frame that leaves the window knows of Λ' is carried on: the marginal prior of a fixed-lag smoother.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.state import POSE, State

Array = NDArray[np.float64]

LOOSE = 1e-9  # stiffness of a pose where the image leaves some of it open: too few points, or none


@dataclass(frozen=True)
class Past:
    """The frame before the first of a window.

    Attributes:
        state: its pose and coefficients, n = 1.
        hold: (k, k) weight on the change of the free rows of Λ' since, by all that is known of them; None for smoothness
            as it is between the frames of a window.
    """

    state: State
    hold: Array | None = None


def known(hessian: Array, rows: tuple[int, ...]) -> Array:
    """What one image says about the given rows of Λ' whatever the pose, (k, k), from its data term's (6 + 3r, 6 + 3r)."""
    pose, deformation = np.arange(POSE), POSE + np.arange(len(hessian) - POSE).reshape(3, -1)[list(rows)].ravel()
    posed = hessian[np.ix_(pose, pose)]
    posed = posed + LOOSE * (1 + np.trace(posed)) * np.eye(POSE)
    mixed = hessian[np.ix_(pose, deformation)]
    return np.asarray(hessian[np.ix_(deformation, deformation)] - mixed.T @ np.linalg.solve(posed, mixed))


def carried(information: Array, link: Array) -> Array:
    """What is left (k, k) of what is known (k, k) of one frame when the next may change at a cost (k,)."""
    loosened = information + np.diag(link)
    held = link[:, None] * np.linalg.solve(loosened, information)
    return np.asarray((held + held.T) / 2)
