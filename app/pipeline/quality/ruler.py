"""A known length on the surface, which makes everything millimetres."""

from array import array
from dataclasses import dataclass, field

import cv2
import numpy as np

from app.arrays import Array, Indices
from app.terminal.errors import UsageError

STEPS = 60  # of a tape along the surface
FARTHEST = 0.15  # of the surface's size, how far off its points an end may lie


@dataclass
class Ruler:
    """A straight line in the first frame, followed on the surface, and its length in every shape.

    Attributes:
        size_mm: what it is said to be.
        corners: (n, 3) the points around each place on the line, and
        weights: (n, 3) what each counts.
        taped: its lengths along the surface so far, as a tape lies on it.
        straight: between its ends.
    """

    size_mm: float
    corners: Indices
    weights: Array
    taped: "array[float]" = field(default_factory=lambda: array("d"))
    straight: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, shape: Array) -> None:
        """Measure one more shape (3, p)."""
        places = np.einsum("dnk,nk->nd", shape[:, self.corners], self.weights)
        self.taped.append(float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum()))
        self.straight.append(float(np.linalg.norm(places[-1] - places[0])))

    def mm_per_px(self, *, along: bool) -> float | None:
        """Millimetres in a unit of the shapes, by the median; None before there is a shape.

        Args:
            along: whether it was measured along the surface, as on a sheet, or straight, as on a solid.
        """
        lengths = self.taped if along else self.straight
        return self.size_mm / float(np.median(lengths)) if lengths else None


def ruler(size_mm: float, ends_px: Array | None, points_px: Array) -> Ruler:
    """A ruler from end to end (2, 2) px of the first frame, by default along the longest side of the points (p, 2).

    Raises:
        UsageError: an end is not on the surface.
    """
    from scipy.spatial import Delaunay  # takes its time to load, and few ask

    ends = longest_side(points_px) if ends_px is None else ends_px
    size = float(np.ptp(points_px, axis=0).max())
    mesh = Delaunay(points_px)
    for x, y in ends:
        off = float(np.linalg.norm(points_px - (x, y), axis=1).min())
        if off > FARTHEST * size:
            raise UsageError(
                f"--between: {x:g} {y:g} is {off:.0f} px off the surface; give two places on it in the first frame"
            )
    line = ends[0] + np.linspace(0, 1, STEPS)[:, None] * (ends[1] - ends[0])
    face = mesh.find_simplex(line)
    outside = face < 0
    if outside.any():  # a little beyond the points: by the triangle that is nearest
        middles = points_px[mesh.simplices].mean(axis=1)
        face[outside] = np.linalg.norm(line[outside, None] - middles, axis=2).argmin(axis=1)
    to_weights = mesh.transform[face]
    two = np.einsum("nij,nj->ni", to_weights[:, :2], line - to_weights[:, 2])
    return Ruler(size_mm, mesh.simplices[face].astype(np.int64), np.column_stack([two, 1 - two.sum(axis=1)]))


def longest_side(points_px: Array) -> Array:
    """The middle line (2, 2) along the longer side of the smallest rectangle around points (p, 2)."""
    box = cv2.boxPoints(cv2.minAreaRect(points_px.astype(np.float32))).astype(np.float64)
    if np.linalg.norm(box[1] - box[0]) > np.linalg.norm(box[2] - box[1]):
        return np.stack([box[0] + box[3], box[1] + box[2]]) / 2
    return np.stack([box[0] + box[1], box[3] + box[2]]) / 2
