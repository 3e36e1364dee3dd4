"""What each frame with a shape tells of its quality."""

from array import array
from dataclasses import dataclass, field

import numpy as np

from reconstruction.estimate import ShapeEstimate


@dataclass
class Course:
    """What each frame with a shape tells of its quality; four numbers a frame.

    Attributes:
        frames: of the source.
        errors: median residual over the image's median radius, which no stray point enlarges; NaN where nothing is seen.
        errors_px: median residual.
        shares: of the points seen.
        lost: frames without the object.
    """

    frames: "array[int]" = field(default_factory=lambda: array("q"))
    errors: "array[float]" = field(default_factory=lambda: array("f"))
    errors_px: "array[float]" = field(default_factory=lambda: array("f"))
    shares: "array[float]" = field(default_factory=lambda: array("f"))
    lost: int = 0

    def add(self, frame: int, estimate: ShapeEstimate) -> None:
        """Add the estimate of a source frame."""
        seen = estimate.residual_px[estimate.visible]
        error_px = float(np.median(seen)) if len(seen) else np.nan
        apart = estimate.projection_px - np.median(estimate.projection_px, axis=0)
        radius_px = float(np.sqrt(np.median((apart**2).sum(axis=1))))
        self.frames.append(frame)
        self.errors.append(error_px / max(radius_px, 1e-12))
        self.errors_px.append(error_px)
        self.shares.append(float(estimate.visible.mean()))
