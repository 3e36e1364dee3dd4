"""What each frame with a shape tells of its quality."""

from array import array
from dataclasses import dataclass, field

import numpy as np

from app.arrays import Array
from reconstruction.estimate import ShapeEstimate

FAR = 0.034  # of the image's median radius: what does not move with the rest is so far off
OFTEN = 1 / 3  # of the frames in which a point is seen: gross errors come and go


@dataclass
class Course:
    """What each frame with a shape tells of its quality; four numbers a frame, and two a point.

    Attributes:
        frames: of the source.
        errors: median residual over the image's median radius, which no stray point enlarges; NaN where nothing is seen.
        errors_px: median residual.
        shares: of the points seen.
        lost: frames without the object.
        seen, far: (P,) in how many frames each point is seen, and is `FAR` off.
    """

    frames: "array[int]" = field(default_factory=lambda: array("q"))
    errors: "array[float]" = field(default_factory=lambda: array("f"))
    errors_px: "array[float]" = field(default_factory=lambda: array("f"))
    shares: "array[float]" = field(default_factory=lambda: array("f"))
    lost: int = 0
    seen: Array = field(default_factory=lambda: np.zeros(0))
    far: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def astray(self) -> float:
        """The share of the points that are far off in many of the frames that show them: they do not move with the rest."""
        return float((self.far > OFTEN * self.seen).mean()) if self.seen.size else 0.0

    def add(self, frame: int, estimate: ShapeEstimate) -> None:
        """Add the estimate of a source frame."""
        seen = estimate.residual_px[estimate.visible]
        error_px = float(np.median(seen)) if len(seen) else np.nan
        apart = estimate.projection_px - np.median(estimate.projection_px, axis=0)
        radius_px = float(np.sqrt(np.median((apart**2).sum(axis=1))))
        if not self.seen.size:
            self.seen, self.far = np.zeros((2, len(estimate.visible)))
        self.seen += estimate.visible
        self.far += estimate.visible & (estimate.residual_px > FAR * radius_px)
        self.frames.append(frame)
        self.errors.append(error_px / max(radius_px, 1e-12))
        self.errors_px.append(error_px)
        self.shares.append(float(estimate.visible.mean()))
