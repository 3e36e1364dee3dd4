"""Compositing: a picture on the moving surface in the video, with the surface's shading, behind what occludes it."""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from scipy.sparse import csr_array

from app.arrays import Array, Flags, Floats, Image, Mask
from app.painting import shading
from app.painting.occlusion import occlusion_mask
from app.painting.picture import Box, Pyramid
from app.painting.raster import Rasteriser, SurfaceMap
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.model import Model

ROUNDS = 20  # of diffusing the points' offsets from the shape over their neighbours
OUTLIER_PX = 1.5  # a point whose offset differs from its neighbours' by this counts half
PAPER = 0.95  # of a picture's full white is what bare paper shows
FEATHER_PX = 0.6  # half-resolution px, of the mask


@dataclass(frozen=True)
class Placement:
    """Where a picture lies in the first frame: x, y, width, height px (None: over the whole mesh); and its opacity."""

    place: Box | None = None
    opacity: float = 1.0


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
        self._place = placement.place or bounding_box(reference_px)
        self._reference_px = reference_px
        self._raster = Rasteriser(mesh.faces, reference_px, (w, h), perspective=perspective)
        self._reference = shading.Reference(first)
        self._shade = np.ones((h // 2, w // 2), np.float32)
        self._mask = np.zeros((h // 2, w // 2), np.uint8)
        self._averages = neighbour_averages(mesh, len(reference_px))
        first_map = self._raster.map(reference_px, np.ones(len(reference_px)))
        covered = np.zeros((h, w), np.uint8)
        if first_map is not None:
            covered[first_map.region] = first_map.cover == 1
        x, y, wide, tall = self._place
        if not covered[max(y, 0) : max(y + tall, 0), max(x, 0) : max(x + wide, 0)].any():
            across, down = np.column_stack([reference_px.min(axis=0), reference_px.max(axis=0)]).round().astype(int)
            raise UsageError(
                f"--place {x} {y} {wide} {tall} is not on the surface, which is between {across[0]} and {across[1]} across "
                f"and {down[0]} and {down[1]} down in the first frame"
            )
        self._first_map, self._first = first_map, first
        self._white = shading.white_level(first, covered)
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
        visible = np.isfinite(observed_px[:, 0])
        points = self.corrected(projection_px, observed_px, visible)
        surface = self._raster.map(points, depth)
        if surface is None:
            return image
        frame = even(image)
        crop = frame[surface.region]
        half = tuple(slice(s.start // 2, s.stop // 2) for s in surface.region)
        view = self._reference.view(crop, surface.uv, surface.cover)
        free = view.inside * (1 - self._mask[half])
        gains = shading.exposure(view, free)
        view = shading.View(view.seen, view.predicted * gains, view.variance, view.inside)
        last = self._shade[half]
        corner = (surface.left, surface.top)
        mask, agreement = occlusion_mask(view, last, self._mask[half], (points - corner - 0.5) / 2, visible)
        shade = shading.shading(view, view.inside * (1 - mask) * agreement, last)
        self._mask[:], self._shade[half] = 0, shade
        self._mask[half] = mask
        return self._blended(image, surface, picture, shade[..., None] * gains, mask)

    def first(self, picture: Image) -> Image:
        """The first frame with the picture on it, in its light."""
        image = self._first[: self._size[1], : self._size[0]]
        if self._first_map is None:
            return image
        h, w = self._first_map.cover.shape
        lit = np.ones((h // 2, w // 2, 3), np.float32)
        return self._blended(image, self._first_map, picture, lit, np.zeros((h // 2, w // 2), np.uint8))

    def corrected(self, projection_px: Array, observed_px: Array, visible: Flags) -> Array:
        """The vertices (p, 2) where they are seen; others are moved off the shape as their neighbours are."""
        seen = np.where(visible, (observed_px - projection_px) @ np.array((1, 1j)), 0.0)
        off = seen
        for _ in range(ROUNDS):
            around = self._averages @ off
            off = around + visible / (1.0 + (np.abs(seen - around) / OUTLIER_PX) ** 2) * (seen - around)
        return np.asarray(projection_px + np.column_stack([off.real, off.imag]))

    def _blended(self, image: Image, surface: SurfaceMap, picture: Image, light: Floats, mask: Mask) -> Image:
        """The frame with the picture at the map's places, times the light (h / 2, w / 2, 3), not where the mask is set."""
        h, w = surface.cover.shape
        if self._pyramid is None or self._pyramid[0] is not picture:
            self._pyramid = (picture, Pyramid(picture, self._place))
        layer = self._pyramid[1].sampled(surface.uv, surface.cover)
        uv = shading.halved(surface.uv)
        white = shading.quadratic(uv[..., 0], uv[..., 1], self._first.shape) @ self._white / PAPER
        light = light * np.clip(white, 0.2, 1.2)[..., None].astype(np.float32)
        light = cast(Floats, cv2.resize(light, (w, h), interpolation=cv2.INTER_LINEAR))
        occluded = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), FEATHER_PX)
        occluded = cv2.resize(occluded, (w, h), interpolation=cv2.INTER_LINEAR)
        share = surface.cover * (1 - occluded) * np.float32(self._opacity)
        colour = cv2.multiply(cv2.cvtColor(layer, cv2.COLOR_BGRA2BGR), light, dtype=cv2.CV_32F)
        colour = cv2.multiply(colour, cv2.merge([share] * 3))
        rest = 1 - share * (layer[..., 3] * np.float32(1 / 255))
        out = even(image).copy()
        region = out[surface.region]
        region[:] = cv2.add(cv2.multiply(region, cv2.merge([rest] * 3), dtype=cv2.CV_32F), colour, dtype=cv2.CV_8U)
        return out[: image.shape[0], : image.shape[1]]


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


def bounding_box(points_px: Array) -> Box:
    """x, y, width, height of the pixels around points (p, 2)."""
    low, high = np.floor(points_px.min(axis=0)).astype(int), np.ceil(points_px.max(axis=0)).astype(int)
    return int(low[0]), int(low[1]), int(high[0] - low[0] + 1), int(high[1] - low[1] + 1)


def neighbour_averages(mesh: Mesh, vertices: int) -> csr_array:
    """A matrix (p, p) that replaces each vertex's value by the mean of its neighbours'."""
    a, b = mesh.edges.T
    degree = np.maximum(np.bincount(mesh.edges.ravel(), minlength=vertices), 1).astype(float)
    rows, columns = np.concatenate([a, b]), np.concatenate([b, a])
    return csr_array((1.0 / degree[rows], (rows, columns)), shape=(vertices, vertices))
