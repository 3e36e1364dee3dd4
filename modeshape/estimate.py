"""The shape of the surface in one frame."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Estimate:
    """A frame's shape: P points, m triangles.

    Attributes:
        index: number of the frame.
        shape: (P, 3) the points in camera axes, in pixels of the first frame; NaN where the surface is lost.
        faces: (m, 3) points of each triangle.
        visible: (P,) which points are seen.
        points_px: (P, 2) where they are seen; NaN where they are not.
        projection_px: (P, 2) where the shape projects them; NaN where the surface is lost.
        sigma: (P,) standard deviation of each point's place in the shape, in its units, with `Settings(uncertainty=True)`;
            else None, as where the surface is lost.
    """

    index: int
    shape: NDArray[np.float64]
    faces: NDArray[np.int64]
    visible: NDArray[np.bool_]
    points_px: NDArray[np.float64]
    projection_px: NDArray[np.float64]
    sigma: NDArray[np.float64] | None = field(default=None, kw_only=True)

    @property
    def lost(self) -> bool:
        """Whether the frame has no shape."""
        return bool(np.isnan(self.shape).any())


@dataclass(frozen=True)
class Frame(Estimate):
    """A frame of a video with its shape.

    Attributes:
        time_s: of the frame.
        image: (H, W, 3) BGR.
        surface: 1, 2, … of the surfaces followed one after another; each has its own points; their faces may change.
        focal_px: of the camera; infinite if it is orthographic.
    """

    time_s: float
    image: NDArray[np.uint8]
    surface: int
    focal_px: float
