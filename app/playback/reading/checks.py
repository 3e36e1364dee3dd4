"""Whether what a recording holds can be: a file may be whole, and yet hold anything."""

import numpy as np
from numpy.typing import NDArray

from app.arrays import Array
from reconstruction.basis.model import Model

LARGEST_PX = 1e6  # a picture's side, and places in it
LARGEST = 1e9  # of a shape, px


def check_model(model: Model, size: Array, texture_px: Array) -> None:
    """Raise a ValueError if a model cannot be one; size (2,) px of the picture, texture_px (P, 2)."""
    basis, mesh = model.basis, model.mesh
    points = basis.rest.shape[1]
    numbers(basis.rest, "the rest shape", LARGEST)
    numbers(basis.Upsilon, "modes", LARGEST)
    numbers(basis.eigenvalues, "eigenvalues")
    numbers(model.camera.center_px, "the camera's centre", LARGEST_PX)
    numbers(texture_px, "places in the texture", LARGEST_PX)
    if not np.ptp(basis.rest, axis=1).any():
        raise ValueError("the rest shape has no extent")
    if not np.allclose(basis.Phi.T @ basis.Phi, np.eye(3), atol=1e-3):
        raise ValueError("the axes of the modes are not at right angles")
    if len(basis.eigenvalues) != len(basis.Upsilon) or len(texture_px) != points:
        raise ValueError("modes, texture and rest shape do not belong together")
    for name, corners in (("faces", mesh.faces), ("edges", mesh.edges)):
        if len(corners) == 0 or corners.min() < 0 or corners.max() >= points:
            raise ValueError(f"{name} name points beyond the {points} there are, or are missing")
    if not model.camera.focal_px > 0:
        raise ValueError(f"a focal length of {model.camera.focal_px}")
    if size.shape != (2,) or not (np.isfinite(size).all() and 1 <= size.min() <= size.max() <= LARGEST_PX):
        raise ValueError(f"pictures of {size} px")


def numbers(values: NDArray[np.generic], name: str, largest: float = np.inf) -> None:
    """Raise a ValueError if there are none, or if some are not finite or larger than can be."""
    known = np.asarray(values, np.float64)
    if known.size == 0 or not np.isfinite(known).all() or np.abs(known).max() > largest:
        raise ValueError(f"{name} that are missing, not finite or too large")
