"""How uncertain a vertex is, as a colour that the mesh's texture is multiplied by."""

import numpy as np
from numpy.typing import NDArray

from app.arrays import Array
from reconstruction.basis.rest_shape import rms_radius

UNSURE = 0.05  # standard deviation over the shape's RMS radius at which a vertex is red; a sure one is white


def colors(sigma: Array | None, shape: Array) -> NDArray[np.uint8] | None:
    """Colours (p, 3) RGB of the vertices (3, p) by their standard deviations (p,); None without."""
    if sigma is None:
        return None
    share = np.clip(sigma / (UNSURE * rms_radius(shape)), 0.0, 1.0)
    other = np.round(255 * (1 - share)).astype(np.uint8)
    return np.stack([np.full_like(other, 255), other, other], axis=1)
