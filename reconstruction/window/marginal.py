"""What the frames that have left the window know of the deformation: an approximate marginal prior (paper §5).

An image says little about depth, but a deformation that lasts while the object turns shows more with every frame. So the
information about Λ' in the frames that have left, their poses marginalised out, is carried along as an information filter
does, and weighs the change of Λ' from the frame that has just left. The exact marginal prior of a fixed-lag smoother, over
pose and Λ' and with its own mean, is less accurate (docs/tried.md).
"""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array
from reconstruction.state import POSE, State

LOOSE = 1e-9  # stiffness of a pose where the image leaves some of it open: too few points, or none


@dataclass(frozen=True)
class Previous:
    """The frame before the first of a window.

    Attributes:
        state: its pose and coefficients, n = 1.
        information: (k, k) weight on the change of the free rows of Λ' since; None for smoothness as between the frames of
            a window.
    """

    state: State
    information: Array | None = None


def information_of(hessian: Array, rows: tuple[int, ...]) -> Array:
    """What one image says about the given rows of Λ', (k, k): its data term's (6 + 3r, 6 + 3r), pose marginalised out."""
    pose, deformation = np.arange(POSE), POSE + np.arange(len(hessian) - POSE).reshape(3, -1)[list(rows)].ravel()
    posed = hessian[np.ix_(pose, pose)]
    posed = posed + LOOSE * (1 + np.trace(posed)) * np.eye(POSE)
    mixed = hessian[np.ix_(pose, deformation)]
    return hessian[np.ix_(deformation, deformation)] - mixed.T @ np.linalg.solve(posed, mixed)


def carried(information: Array, link: Array) -> Array:
    """Information (k, k) about the next frame's Λ', given that about this one's (k, k) and the weight of a change (k,)."""
    loosened = information + np.diag(link)
    held = link[:, None] * np.linalg.solve(loosened, information)
    return (held + held.T) / 2
