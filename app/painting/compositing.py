"""Compositing: a picture on the moving surface in the video, with the surface's shading, behind what occludes it."""

from dataclasses import replace
from typing import cast

import cv2
import numpy as np

from app.arrays import Array, Floats, Image, Mask
from app.painting import edge, shading
from app.painting.evidence import Moved
from app.painting.occlusion import Occlusion, Tracked
from app.painting.outline import Outline
from app.painting.picture import Pyramid
from app.painting.placement import Placement, extent
from app.painting.raster import Rasteriser, SurfaceMap
from app.painting.surface import Surface
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.model import Model

PAPER = 0.95  # of a picture's full white is what bare paper shows
WHITE_PX = 8  # of the first frame, for one of the map that says how bright white is there
EDGE_PX = 0.7  # of the surface where its outline is not straight
AROUND = 6  # half-resolution px around what is in front that are looked at for its edge


class Compositor:
    """Paints frame after frame, in order: shading and occlusion mask are carried from each to the next.

    Args:
        first: (H, W, 3) BGR the first frame.
        reference_px: (p, 2) the vertices in it.
        mesh: the surface.
        perspective: whether the camera is.
        placement: where the picture lies.

    Raises:
        UsageError: that is not on the surface.
    """

    def __init__(
        self, first: Image, reference_px: Array, mesh: Mesh, *, perspective: bool, placement: Placement | None = None
    ) -> None:
        placement = placement or Placement()
        self._size = first.shape[1::-1]
        first = even(first)
        h, w = first.shape[:2]
        self._opacity = placement.opacity
        self._perspective = perspective
        self._vertices, mesh = mesh.vertices, mesh.alone()
        self._reference_px = reference_px = reference_px[self._vertices]
        reach = extent(placement.outline, reference_px, mesh.faces, (w, h))
        self._corners = reach.quad if placement.corners is None else placement.corners
        self._surface = Surface(reference_px, mesh, reach.quad, reach.region, sheet=reach.told)
        net = self._surface.net
        self._region = None if reach.region is None else cast(Mask, cv2.GaussianBlur(reach.region, (0, 0), EDGE_PX))
        self._outline = Outline(self._surface.shape, first, net.nodes_px) if reach.told else None
        self._raster = Rasteriser(net.faces, net.nodes_px, (w, h), perspective=perspective)
        self._reference = shading.Reference(first)
        self._shade = np.ones((h // 2, w // 2), np.float32)
        self._occlusion = Occlusion((w // 2, h // 2))
        self._before: tuple[Floats, Array] | None = None  # the frame before at half the resolution, and the nodes in it
        first_map = self._mapped(net.nodes_px, np.ones(len(net.nodes_px)))
        covered = np.zeros((h, w), np.uint8)
        if first_map is not None:
            covered[first_map.region] = first_map.cover == 1
        wanted = np.zeros((h, w), np.uint8)
        cv2.fillConvexPoly(wanted, np.rint(self._corners).astype(np.int32), 1)
        if not (covered & wanted).any():
            raise UsageError(f"--place is not on the surface, which is {told(reach.quad)} in the first frame")
        self._first_map, self._first = first_map, first
        across, down = np.meshgrid(*((np.arange(-(-side // WHITE_PX)) + 0.5) * WHITE_PX - 0.5 for side in (w, h)))
        white = shading.quadratic(across, down, first.shape) @ shading.white_level(first, covered) / PAPER
        self._white = np.clip(white, 0.2, 1.2).astype(np.float32)
        self._pyramid: tuple[Image, Pyramid] | None = None

    def paint(self, image: Image, picture: Image, projection_px: Array, depth: Array, observed_px: Array) -> Image:
        """A frame with the picture on the surface; pixels outside the surface stay as they are.

        Args:
            image: (H, W, 3) BGR the frame.
            picture: (h, w, 4) BGR, premultiplied, and alpha.
            projection_px: (p, 2) the vertices as the shape projects them.
            depth: (p,) their depths.
            observed_px: (p, 2) where they are seen, NaN where they are not.
        """
        projection_px, depth, observed_px = (of_all[self._vertices] for of_all in (projection_px, depth, observed_px))
        points = self._surface.corrected(projection_px, observed_px)
        nodes, depths = self._surface.nodes(projection_px, depth, points, perspective=self._perspective)
        if self._outline is not None:
            nodes = self._surface.stretched(nodes, self._outline.border, self._outline.off(image, nodes))
        surface = self._mapped(nodes, depths)
        if surface is None:
            return image
        frame = shading.halved(even(image))
        part = tuple(slice(s.start // 2, s.stop // 2) for s in surface.region)
        view = self._reference.view(frame[part], surface.uv, surface.cover)
        gains = shading.exposure(view, view.inside * (1 - self._occlusion.mask[part]))
        view = shading.View(view.seen, view.predicted * gains, view.variance, view.inside)
        corner = (surface.left, surface.top)
        tracked = Tracked((points - corner - 0.5) / 2, np.isfinite(observed_px[:, 0]))
        moved = self._moved(surface, nodes)
        last = self._shade[part]
        mask, agreement = self._occlusion.update(part, view, last, moved, tracked)
        shade = shading.shading(view, view.inside * (1 - mask) * agreement, last)
        self._shade[part] = shade
        self._before = (frame, nodes)
        return self._blended(image, surface, picture, shade[..., None] * gains, mask)

    def _moved(self, surface: SurfaceMap, nodes: Array) -> Moved:
        """The frame before, and how far the surface's pixels have come since."""
        frame, before = self._before or (None, nodes)

        def displacement() -> Floats:
            return self._surface.carried((nodes - before) / 2, shading.halved(surface.uv))

        return Moved(frame, displacement, (surface.left // 2, surface.top // 2))

    def first(self, picture: Image) -> Image:
        """The first frame with the picture on it, in its light."""
        image = self._first[: self._size[1], : self._size[0]]
        if self._first_map is None:
            return image
        h, w = self._first_map.cover.shape
        lit = np.ones((h // 2, w // 2, 3), np.float32)
        return self._blended(image, self._first_map, picture, lit, np.zeros((h // 2, w // 2), np.uint8))

    def _mapped(self, nodes_px: Array, depth: Array) -> SurfaceMap | None:
        """Where the surface is seen, with the net's nodes (q, 2) there, at depths (q,)."""
        surface = self._raster.map(nodes_px, depth)
        if surface is None or self._region is None:
            return surface
        share = shading.sampled(self._region, surface.uv, cv2.BORDER_CONSTANT).astype(np.float32)
        return replace(surface, cover=surface.cover * (share * np.float32(1 / 255)))

    def _blended(self, image: Image, surface: SurfaceMap, picture: Image, light: Floats, mask: Mask) -> Image:
        """The frame with the picture at the map's places, times the light (h / 2, w / 2, 3), behind what the mask shows."""
        h, w = surface.cover.shape
        if self._pyramid is None or self._pyramid[0] is not picture:
            self._pyramid = (picture, Pyramid(picture, self._corners))
        layer = self._pyramid[1].sampled(surface.uv, surface.cover)
        coarse = (shading.halved(surface.uv) + np.float32(0.5)) * np.float32(1 / WHITE_PX) - np.float32(0.5)
        lit = light * shading.sampled(self._white, coarse, cv2.BORDER_REPLICATE)[..., None]
        share = surface.cover * np.float32(self._opacity)
        colour = cv2.cvtColor(layer, cv2.COLOR_BGRA2BGR)
        colour = cv2.multiply(colour, edge.enlarged(lit, (w, h)), dtype=cv2.CV_32F)
        colour = cast(Floats, cv2.multiply(colour, cv2.merge([share] * 3)))
        rest = 1 - share * (layer[..., 3] * np.float32(1 / 255))
        out = even(image).copy()
        region = out[surface.region]
        part, part2 = around(mask)
        before = region[part2].copy()
        region[:] = cv2.add(cv2.multiply(region, cv2.merge([rest] * 3), dtype=cv2.CV_32F), colour, dtype=cv2.CV_8U)
        if before.size:
            region[part2] = edge.composed(before, region[part2], mask[part])
        return out[: image.shape[0], : image.shape[1]]


def around(mask: Mask) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Rows and columns around what is set in a mask (h, w), at its resolution and at twice that."""
    box = cv2.boundingRect(mask)
    (h, w), (x, y, wide, tall) = mask.shape, box
    if not wide:
        return (slice(0, 0), slice(0, 0)), (slice(0, 0), slice(0, 0))
    rows = slice(max(y - AROUND, 0), min(y + tall + AROUND, h))
    columns = slice(max(x - AROUND, 0), min(x + wide + AROUND, w))
    return (rows, columns), (slice(2 * rows.start, 2 * rows.stop), slice(2 * columns.start, 2 * columns.stop))


def painted(first: Image, reference_px: Array, model: Model, picture: Image, placement: Placement) -> Image:
    """The first frame with the picture on it.

    Raises:
        UsageError: it is not on the surface.
    """
    compositor = Compositor(first, reference_px, model.mesh, perspective=model.camera.perspective, placement=placement)
    return compositor.first(picture)


def even(image: Image) -> Image:
    """The picture, its last row and column repeated where that makes its sizes even."""
    h, w = image.shape[:2]
    if h % 2 == 0 and w % 2 == 0:
        return image
    return cast(Image, cv2.copyMakeBorder(image, 0, h % 2, 0, w % 2, cv2.BORDER_REPLICATE))


def told(corners: Array) -> str:
    """Corners (n, 2) in words."""
    return ", ".join(f"{x:.0f} {y:.0f}" for x, y in corners)
