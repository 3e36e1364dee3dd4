"""Where a picture lies on a surface: all over it, along its axes, or where somebody wants it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from app.arrays import Array, Indices, Mask
from app.painting.surface import Surface, first_frame_px
from reconstruction.basis.mesh import Mesh

Box = tuple[int, int, int, int]

FOUR_SIDED = 1.15  # area of the least figure of four sides around it over its own, of what has about four sides
STRAIGHT = 1.05  # the same, of what is a figure of four sides but for its last points
ON_SURFACE = 0.8  # share of the vertices that an outline has to go around, if it is theirs
BEYOND_PX = 3.0  # that vertices may be outside of it


@dataclass(frozen=True)
class Placement:
    """Where a picture lies in the first frame, and how.

    Attributes:
        corners: (4, 2) px of the picture's top left, top right, bottom right and bottom left; None: all over the surface.
        opacity: 0 to 1.
        outline: (n, 2) px the surface's corners, where somebody has told them; only four are those of a sheet.
    """

    corners: Array | None = None
    opacity: float = 1.0
    outline: Array | None = None


@dataclass(frozen=True)
class Extent:
    """The surface in the first frame.

    Attributes:
        quad: (4, 2) px a figure around it, along its axes, from its top left clockwise as the picture shows it.
        region: (H, W) 255 where it is; None: all of `quad`.
        told: whether somebody has told that it has these four corners.
    """

    quad: Array
    region: Mask | None
    told: bool = False


def extent(outline: Array | None, reference_px: Array, faces: Indices, size: tuple[int, int]) -> Extent:
    """How far a surface reaches: to its outline where that is known, else as far as its mesh.

    Args:
        outline: (n, 2) px or None; one that is around something else is not taken.
        reference_px: (p, 2) the vertices.
        faces: (m, 3) of the mesh.
        size: (width, height) of the picture.
    """
    if outline is not None:
        curve = outline.astype(np.float32)
        inside = [cv2.pointPolygonTest(curve, (float(x), float(y)), measureDist=True) > -BEYOND_PX for x, y in reference_px]
        if np.mean(inside) < ON_SURFACE:
            outline = None
    if outline is not None and len(outline) == 4:
        return Extent(upright(outline), None, told=True)
    region = np.zeros(size[::-1], np.uint8)
    if outline is not None:
        cv2.fillPoly(region, [np.rint(outline).astype(np.int32)], 255)
        return Extent(four_corners(outline)[0], region)
    quad, excess = four_corners(reference_px)
    if excess <= STRAIGHT:
        return Extent(quad, None)
    for face in faces:
        cv2.fillConvexPoly(region, np.rint(reference_px[face]).astype(np.int32), 255)
    return Extent(quad, region)


def outline_of(corners: Sequence[float] | None) -> Array | None:
    """An outline (n, 2) px by x, y, x, y, … of its corners."""
    return None if corners is None else np.reshape(corners, (-1, 2)).astype(float)


def corners_of(place: tuple[float, ...] | None) -> Array | None:
    """The corners (4, 2) px of x, y, width and height, or of x, y, x, y, … of the four."""
    if place is None:
        return None
    return box_corners(place) if len(place) == 4 else np.reshape(place, (4, 2)).astype(float)


def four_corners(points: Array) -> tuple[Array, float]:
    """The corners (4, 2) of a figure around points (n, 2), and its area over their hull's.

    Of what has about four sides, the least figure of four sides; else the rectangle of pixels.
    """
    hull = cv2.convexHull(points.astype(np.float32))
    area = max(cv2.contourArea(hull), 1e-9)
    if len(hull) >= 4:
        around = cv2.approxPolyN(hull, 4, epsilon_percentage=-1.0, ensure_convex=True).reshape(-1, 2)
        excess = cv2.contourArea(around) / area
        if len(around) == 4 and excess <= FOUR_SIDED:
            return upright(around.astype(float)), excess
    box = box_corners(bounding_box(points))
    return box, cv2.contourArea(box.astype(np.float32)) / area


def upright(quad: Array) -> Array:
    """Four corners (4, 2), however they go round, from the top left on, clockwise as the picture shows them."""
    x, y = (quad - np.roll(quad, 1, axis=0)).T
    turning = x * np.roll(y, -1) - y * np.roll(x, -1)
    quad = quad if turning.sum() > 0 else quad[::-1]
    sides = [np.roll(quad, -k, axis=0) for k in range(4)]
    return max(sides, key=lambda q: float((q[1] - q[0] + q[2] - q[3])[0]))


def box_corners(box: tuple[float, ...]) -> Array:
    """The corners (4, 2) of x, y, width, height px: outer borders of pixels, whose centres are at whole numbers."""
    x, y, wide, tall = box
    return np.array(((x, y), (x + wide, y), (x + wide, y + tall), (x, y + tall)), float) - 0.5


def bounding_box(points_px: Array) -> Box:
    """x, y, width, height of the pixels around points (p, 2)."""
    low, high = np.floor(points_px.min(axis=0)).astype(int), np.ceil(points_px.max(axis=0)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0] + 1), int(high[1] - low[1] + 1)


def in_first_frame(
    placement: Placement,
    at: tuple[Array, Array, Array],
    reference_px: Array,
    mesh: Mesh,
    size: tuple[int, int],
    *,
    perspective: bool,
) -> Placement:
    """A placement whose corners are told in another frame, with them where they are in the first.

    Args:
        placement: the corners as told.
        at: of that frame, the vertices as the shape projects them (p, 2) px, their depths (p,), where they are seen (p, 2).
        reference_px: (p, 2) the vertices in the first frame.
        mesh: their triangles.
        size: (width, height) of the picture.
        perspective: whether the camera is.
    """
    assert placement.corners is not None
    vertices, mesh = mesh.vertices, mesh.alone()
    reference_px = reference_px[vertices]
    reach = extent(placement.outline, reference_px, mesh.faces, size)
    surface = Surface(reference_px, mesh, reach.quad, None, sheet=reach.told)
    projection_px, depth, observed_px = (of_all[vertices] for of_all in at)
    points = surface.corrected(projection_px, observed_px)
    nodes, _ = surface.nodes(projection_px, depth, points, perspective=perspective)
    return replace(placement, corners=first_frame_px(placement.corners, nodes, surface.net))
