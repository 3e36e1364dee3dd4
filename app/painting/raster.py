"""From a moving triangle mesh to a map: for every pixel of the picture, the place in the first frame it shows.

Pixel centres are at whole numbers, as in OpenCV. Everything is vectorised over triangles: these are cut into
horizontal spans, the spans into pixels, so that exactly the covered pixels are touched, each once.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from app.arrays import Array, Flags, Floats, Indices

Places = NDArray[np.complex64]  # u + iv: NumPy moves one complex number faster than two real ones

MARGIN_PX = 2
SPAN_PX = 8  # longer spans are divided
NEIGHBOURS = np.ones((3, 3), np.uint8)


@dataclass(frozen=True)
class SurfaceMap:
    """The part of the picture where the surface is seen from its front.

    Attributes:
        left, top: place of the part in the picture, px, even numbers; so are its sizes unless the picture's are odd.
        uv: (h, w, 2) float32, px in the first frame of what a pixel shows; 0 where `cover` is 0.
        cover: (h, w) float32, share of the pixel that the surface covers: 0, 1, or in between at its edge.
    """

    left: int
    top: int
    uv: Floats
    cover: Floats

    @property
    def region(self) -> tuple[slice, slice]:
        """Rows and columns in the picture."""
        h, w = self.cover.shape
        return slice(self.top, self.top + h), slice(self.left, self.left + w)


@dataclass(frozen=True)
class Spans:
    """Runs of pixels in a row, (s,) each: the triangle they belong to, row, first column and length."""

    face: Indices
    y: Indices
    x: Indices
    count: Indices


class Rasteriser:
    """Draws a mesh whose vertices move.

    Args:
        faces: (m, 3) triangles.
        reference_px: (p, 2) the vertices in the first frame, where all triangles are seen from the front.
        size: (width, height) of the picture.
        perspective: whether the camera is; then straight lines in the first frame stay straight inside a triangle.
    """

    def __init__(self, faces: Indices, reference_px: Array, size: tuple[int, int], *, perspective: bool) -> None:
        self._reference, self._size, self._perspective = reference_px, size, perspective
        flipped = doubled_areas(reference_px, faces) < 0
        self._faces = np.where(flipped[:, None], faces[:, ::-1], faces)
        self._edges, self._sides = sides_of_edges(self._faces)

    def map(self, points_px: Array, depth: Array) -> SurfaceMap | None:
        """Where the surface is seen.

        Args:
            points_px: (p, 2) the vertices in the picture.
            depth: (p,) their depths; of a perspective camera, distances.

        Returns:
            the map; None where nothing is in view.
        """
        size = np.array(self._size)
        if not np.isfinite(points_px).all() or (self._perspective and depth.min() <= 0):
            return None
        # On even numbers, so that the part can be halved.
        low = np.floor(np.maximum(points_px.min(axis=0) - MARGIN_PX, 0) / 2).astype(np.int64) * 2
        high = np.minimum(np.ceil(np.minimum(points_px.max(axis=0) + MARGIN_PX, size) / 2).astype(np.int64) * 2, size)
        if (high <= low).any():
            return None
        w, h = (high - low).tolist()
        points = points_px - low
        # Both are linear over the picture: 1 / z under perspective, z itself otherwise.
        weight = 1.0 / depth if self._perspective else np.ones_like(depth)
        nearness = weight if self._perspective else -depth
        runs = spans(points, self._faces, (w, h))
        span, step, pixel = pixels_of_spans(runs, w)
        front = self._front(points)
        if len(pixel) and np.bincount(pixel).max() > 1:
            kept = frontmost(pixel, self._faces, points, nearness, runs.face[span], w)
            span, step, pixel = span[kept], step[kept], pixel[kept]
        if not front.all():
            kept = np.flatnonzero(front[runs.face[span]])
            span, step, pixel = span[kept], step[kept], pixel[kept]
        begin, end = self._coordinates(runs, points, weight)
        uv, inside = np.zeros(h * w, np.complex64), np.zeros(h * w, np.uint8)
        # Exact at both ends of a span, and spans are short: in between a straight line will do.
        uv[pixel] = begin[span] + ((end - begin) / np.maximum(runs.count - 1, 1)).astype(np.complex64)[span] * step
        inside[pixel] = 1
        cover = self._smooth_edge(points, front, uv, inside.reshape(h, w))
        return SurfaceMap(int(low[0]), int(low[1]), uv.view(np.float32).reshape(h, w, 2), cover)

    def _coordinates(self, runs: Spans, points: Array, weight: Array) -> tuple[Places, Places]:
        """First-frame places u + iv (s,) of the first and the last pixels of spans."""
        planes = plane_coefficients(points, self._faces, np.column_stack([self._reference * weight[:, None], weight]))
        planes = planes[runs.face]
        first = planes[..., 0] * runs.x[:, None] + planes[..., 1] * runs.y[:, None] + planes[..., 2]
        last = first + planes[..., 0] * (runs.count - 1)[:, None]
        begin, end = ((p[:, 0] + 1j * p[:, 1]) / p[:, 2] for p in (first, last))
        return begin.astype(np.complex64), end.astype(np.complex64)

    def _front(self, points: Array) -> Flags:
        """Which triangles (m,) show their front; decided with their neighbours, since noise turns slivers over."""
        areas = np.repeat(doubled_areas(points, self._faces), 3)
        around = np.bincount(self._faces.ravel(), areas, minlength=len(points))
        a, b, c = self._faces.T
        return np.asarray(around[a] + around[b] + around[c] > 0)

    def _smooth_edge(self, points: Array, front: Flags, uv: Places, inside: NDArray[np.uint8]) -> Floats:
        """Share of the surface (h, w) in each pixel, from the distance to its outline; completes `uv` along it."""
        h, w = inside.shape
        cover = inside.astype(np.float32)
        outline = self._edges[np.append(front, False)[self._sides].sum(axis=1) == 1]
        if not len(outline):
            return cover
        a, b = points[outline[:, 0]], points[outline[:, 1]]
        low = np.clip(np.floor(np.minimum(a, b)).astype(np.int64) - 1, 0, (w, h))
        high = np.clip(np.ceil(np.maximum(a, b)).astype(np.int64) + 2, low, (w, h))
        wide, tall = (high - low).T
        count = wide * tall
        segment = np.repeat(np.arange(len(outline)), count)
        step = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
        column, row = low[segment, 0] + step % wide[segment], low[segment, 1] + step // wide[segment]
        start, along = a[:, 0] + 1j * a[:, 1], (b - a)[:, 0] + 1j * (b - a)[:, 1]
        # In units of the segment: its ends are 0 and 1.
        place = (column + 1j * row - start[segment]) / np.where(along == 0, 1e-9, along)[segment]
        share = np.clip(place.real, 0, 1)
        distance = np.abs(place - share) * np.abs(along)[segment]
        near = np.flatnonzero(distance < 0.5)
        # Where the outline lies in front of another part of the surface, there is no background to blend with.
        edge = (cv2.erode(inside, NEIGHBOURS) == 0) & (cv2.dilate(inside, NEIGHBOURS) > 0)
        near = near[edge[row[near], column[near]]]
        near = near[np.argsort(-distance[near], kind="stable")]  # of several assignments, the last and nearest stays
        row, column, share, distance = row[near], column[near], share[near], distance[near]
        within = inside[row, column] > 0
        cover[row, column] = np.where(within, 0.5 + distance, 0.5 - distance)
        ends = self._reference[outline[segment[near]]] @ np.array((1, 1j))
        uv[(row * w + column)[~within]] = (ends[:, 0] + share * (ends[:, 1] - ends[:, 0]))[~within]
        return cover


def doubled_areas(points: Array, faces: Indices) -> Array:
    """Twice the signed areas (m,) of the triangles of points (p, 2)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def sides_of_edges(faces: Indices) -> tuple[Indices, Indices]:
    """Unique edges (n, 2), and the one or two faces (n, 2) at each; −1 for none."""
    pairs = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges, which = np.unique(pairs, axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    owner = (np.arange(len(pairs)) % len(faces))[order]
    edge = which.ravel()[order]
    second = np.append(False, edge[1:] == edge[:-1])
    sides = np.full((len(edges), 2), -1)
    sides[edge, second.astype(np.int64)] = owner
    return edges, sides


def spans(points: Array, faces: Indices, size: tuple[int, int]) -> Spans:
    """Pixels of a picture of `size` (width, height) with centres in the triangles; neighbours share none, and miss none."""
    width, height = size
    corners = points[faces]
    order = np.argsort(corners[..., 1], axis=1, kind="stable")
    top, middle, bottom = np.moveaxis(np.take_along_axis(corners, order[..., None], axis=1), 1, 0)
    first = np.clip(np.ceil(top[:, 1]), 0, height).astype(np.int64)
    rows = np.clip(np.ceil(bottom[:, 1]), first, height).astype(np.int64) - first
    face = np.repeat(np.arange(len(faces)), rows)
    y = np.arange(len(face)) - np.repeat(np.cumsum(rows) - rows - first, rows)
    t, m, b = top[face], middle[face], bottom[face]
    upper = y < m[:, 1]
    start, end = np.where(upper[:, None], t, m), np.where(upper[:, None], m, b)
    x_short, x_long = crossing(start, end, y), crossing(t, b, y)
    x = np.clip(np.ceil(np.minimum(x_short, x_long)), 0, width).astype(np.int64)
    count = np.clip(np.ceil(np.maximum(x_short, x_long)), x, width).astype(np.int64) - x
    parts = -(-count // SPAN_PX)
    part = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    face, y, x, count = (np.repeat(a, parts) for a in (face, y, x, count))
    return Spans(face, y, x + part * SPAN_PX, np.minimum(count - part * SPAN_PX, SPAN_PX))


def crossing(start: Array, end: Array, y: Indices) -> Array:
    """Where the lines from `start` to `end` (s, 2), listed downwards, cross the rows (s,)."""
    # The same edge gives the same number in both of its triangles: the order of its ends is fixed by the rows.
    fall = np.maximum(end[:, 1] - start[:, 1], 1e-12)
    return np.asarray(start[:, 0] + (y - start[:, 1]) / fall * (end[:, 0] - start[:, 0]))


def pixels_of_spans(runs: Spans, width: int) -> tuple[Indices, Indices, Indices]:
    """Of each pixel (n,): its span, its place in the span, and its number in the picture, row by row."""
    span = np.repeat(np.arange(len(runs.face)), runs.count)
    step = np.arange(len(span)) - np.repeat(np.cumsum(runs.count) - runs.count, runs.count)
    return span, step, np.repeat(runs.y * width + runs.x, runs.count) + step


def frontmost(pixel: Indices, faces: Indices, points: Array, nearness: Array, face: Indices, width: int) -> Indices:
    """Which of (n,) pixels of triangles, numbered `face` (n,), are not behind another triangle's."""
    several = np.bincount(pixel)[pixel] > 1
    overlapping = np.flatnonzero(several)
    plane = plane_coefficients(points, faces, nearness[:, None])[face[overlapping], 0]
    place = pixel[overlapping]
    near = plane[:, 0] * (place % width) + plane[:, 1] * (place // width) + plane[:, 2]
    order = np.lexsort((near, place))
    nearest = np.append(place[order][1:] != place[order][:-1], True)
    return np.concatenate([np.flatnonzero(~several), overlapping[order[nearest]]])


def plane_coefficients(points: Array, faces: Indices, values: Array) -> Array:
    """Coefficients (m, k, 3) of x, y and 1 for values (p, k) that are linear over each triangle."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    e, f = b - a, c - a
    area = e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0]
    area = np.where(np.abs(area) < 1e-9, 1e-9, area)[:, None]
    at, to_b, to_c = (values[faces[:, k]] for k in range(3))
    to_b, to_c = (to_b - at) / area, (to_c - at) / area
    across = to_b * f[:, 1:] - to_c * e[:, 1:]
    down = to_c * e[:, :1] - to_b * f[:, :1]
    return np.stack([across, down, at - across * a[:, :1] - down * a[:, 1:]], axis=-1)
