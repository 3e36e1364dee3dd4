"""What a viewer draws of a shape: mesh, wireframe, points that are not seen, curves. All of it follows from pose and Λ."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from app.arrays import Array, Flags
from app.recording import entities
from app.recording.modes import MOVEMENT_RGB
from app.recording.stream import Stream
from app.recording.styles import LEADING
from app.recording.wireframe import Strips
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import rms_radius
from reconstruction.basis.surface import Surface
from reconstruction.estimate import ShapeEstimate

RELIEF = 0.7  # depth beyond the middle, over the shape's RMS radius, at which the colours end
LEVELS = 32  # of colours: few can be packed
STRETCHED = 0.05  # strain at which the colours end, ...
BENT = 1.0  # ... and curvature, times the rest shape's RMS radius
UNSURE = 0.05  # standard deviation over the shape's RMS radius at which a vertex is red; a sure one is white


class Tint:
    """Colours by how a shape is deformed: blue is shorter or hollow, white as at rest or flat, red longer or bulging.

    Args:
        kind: by what.
        model: of the shapes.
    """

    def __init__(self, kind: Literal["strain", "curvature"], model: Model) -> None:
        self._kind, rest = kind, model.basis.rest
        self._surface = Surface(rest, model.mesh.faces)
        self._most = STRETCHED if kind == "strain" else BENT / rms_radius(rest)

    def colors(self, shape: Array) -> NDArray[np.uint32]:
        """Colours (p,) 0xRRGGBBAA of the vertices (3, p)."""
        values = self._surface.strain(shape) if self._kind == "strain" else self._surface.curvature(shape)
        return levels(np.nan_to_num(values) / self._most)


@dataclass(frozen=True)
class Shape:
    """An estimate without what follows from it and its model, to be drawn now or later.

    Attributes:
        time_s: of its frame.
        model: what it is of.
        strips: the wireframe of the model's mesh.
        tint: colours of the model's shapes; None for those of depth or uncertainty.
        errors_px: (2,) RMS and median of the reprojection errors; (0,) if no point was seen.
        others: those of a `ShapeEstimate`.
    """

    time_s: float
    model: Model
    strips: Strips
    tint: Tint | None
    R: Array
    t: Array
    s: float
    Lambda: Array
    visible: Flags
    sigma: Array | None
    errors_px: Array

    @classmethod
    def of(cls, time_s: float, model: Model, strips: Strips, tint: Tint | None, estimate: ShapeEstimate) -> Self:
        """Of a frame's estimate."""
        e, residuals = estimate, estimate.residual_px[np.isfinite(estimate.residual_px)]
        errors = np.array([np.sqrt(np.mean(residuals**2)), np.median(residuals)] if residuals.size else [])
        return cls(time_s, model, strips, tint, e.R, e.t, e.s, e.Lambda, e.visible, e.sigma, errors)


def draw(stream: Stream, shape: Shape) -> None:
    """Write what shows the shape of the stream's frame."""
    vertices = shape.model.shape(shape.R, shape.t, shape.s, shape.Lambda)
    projection = shape.model.camera.project(vertices).T.astype(np.float32)
    if shape.tint is not None:
        colors = shape.tint.colors(vertices)
    else:
        colors = depth_colors(vertices) if shape.sigma is None else uncertainty_colors(shape.sigma, vertices)
    stream.row(entities.MESH, rr.Mesh3D.columns, vertex_positions=vertices.T.astype(np.float32), vertex_colors=colors)
    stream.row(entities.WIREFRAME, rr.LineStrips2D.columns, strips=shape.strips.through(projection))
    drawn = shape.model.mesh.vertices
    stream.points(entities.PREDICTED, projection[drawn[~shape.visible[drawn]]])
    if shape.errors_px.size:
        stream.scalars(entities.ERROR, *shape.errors_px)
    spectrum = rr.components.TensorDataBatch(shape.Lambda.astype(np.float32).ravel()).as_arrow_array()
    stream.row(entities.SPECTRUM, rr.BarChart.columns, values=spectrum)
    stream.scalars(entities.LEADING, *shape.Lambda[:, :LEADING].ravel())


def uncertainty_colors(sigma: Array, shape: Array) -> NDArray[np.uint32]:
    """Colours (p,) 0xRRGGBBAA of the vertices (3, p) by their standard deviations (p,): from white to red."""
    share = np.clip(sigma / (UNSURE * rms_radius(shape)), 0.0, 1.0)
    other = np.round(255 * (1 - share)).astype(np.uint32)
    return np.asarray(0xFF0000FF + (other << 16) + (other << 8), np.uint32)


def depth_colors(shape: Array) -> NDArray[np.uint32]:
    """Colours (p,) 0xRRGGBBAA of the vertices (3, p): nearer than the middle is blue, farther is red."""
    return levels((shape[2] - shape[2].mean()) / (RELIEF * rms_radius(shape)))


def levels(values: Array) -> NDArray[np.uint32]:
    """Colours (p,) 0xRRGGBBAA of numbers (p,): -1 is blue, 0 is white, 1 is red."""
    return RAMP[np.rint(np.clip(values / 2 + 0.5, 0.0, 1.0) * (LEVELS - 1)).astype(np.int64)]


def ramp() -> NDArray[np.uint32]:
    """Colours (LEVELS,) 0xRRGGBBAA from blue over white to red."""
    place, stops = np.linspace(0, 1, LEVELS), np.linspace(0, 1, len(MOVEMENT_RGB))
    red, green, blue = (np.rint(np.interp(place, stops, channel)).astype(np.uint32) for channel in MOVEMENT_RGB.T)
    return np.asarray(red << 24 | green << 16 | blue << 8 | 255, np.uint32)


RAMP = ramp()
