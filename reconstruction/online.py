"""The on-line estimator: one observation in, the shapes it settles out."""

from dataclasses import dataclass

from numpy.typing import NDArray
import numpy as np

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ShapeEstimate:
    """One frame's pose and shape: S = R(S̄ + ΦΛΥ) moved in front of the camera (Eq. 3, 8).

    Attributes:
        frame: index in the order of observation.
        quaternion: (4,) of R, w first.
        R: (3, 3) rotation.
        t: (2,) image translation, px: where the shape's origin is seen, relative to the principal point.
        s: scale; the origin's depth is focal/s.
        Lambda: (3, r) coefficients Γ_α, Γ_β, Γ_τ, px.
        shape: (3, p) deformed shape in camera axes (x right, y down, z forward), pixels of the first frame.
        projection_px: (p, 2) the shape seen by the camera.
        residual_px: (p,) distance to the observation, NaN where not visible.
        visible: (p,) h^f.
    """

    frame: int
    quaternion: Array
    R: Array
    t: Array
    s: float
    Lambda: Array
    shape: Array
    projection_px: Array
    residual_px: Array
    visible: NDArray[np.bool_]
