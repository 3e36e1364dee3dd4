"""The camera: pictures of the moving sheet, exact to a few hundredths of a pixel.

No triangles are drawn. The sheet is a cylinder, so the line of sight through a pixel, looked at along the
rulings, meets a plane curve; a table over the slope of that line gives the place on the curve, the
nearest one where the curve hides itself. Pixel centres are at whole numbers, as in OpenCV.
"""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from app.arrays import Array, Flags, Floats
from app.demo.hand import hand_layer
from app.demo.motion import HEIGHT_MM, WIDTH_MM, Surface, grid, surface

SIZE = (640, 480)
"""Width and height of the video."""
PAGE, DESK = (Path(__file__).with_name(name) for name in ("page.png", "desk.png"))
"""What is printed on the sheet, from edge to edge; what is seen without a sheet. Drawn by docs/sample."""
K = np.array([(600.0, 0.0, 320.0), (0.0, 600.0, 240.0), (0.0, 0.0, 1.0)])
"""Intrinsics: the focal length is not the width, so a program that assumes so is put to the test."""

_FINER = 2
_TABLE = 4096
_PAGE_PX_PER_MM = 3
_LAMP_MM = np.array([-600.0, -640.0, -360.0])
_LAMP_REACH_MM = 1240.0
_AMBIENT = 0.27
_NOISE = 1.4


def render(frame: int, *, hand: bool = True) -> NDArray[np.uint8]:
    """The picture (480, 640, 3) BGR of a frame, with or without the hand that reaches over the sheet.

    The same frame gives the same bytes.
    """
    sheet = surface(frame)
    picture = _ground() * (1 - 0.42 * _shadow(sheet))[..., None]
    left, top, cover = _cover(sheet)
    region = picture[top : top + cover.shape[0], left : left + cover.shape[1]]
    region *= 1 - cover[..., 3:] / 255
    region += cover[..., :3]
    layer = hand_layer(frame, SIZE) if hand else None
    if layer is not None:
        offset = np.array([(1, 0, 16), (0, 1, 20)], float)
        cast = np.asarray(cv2.warpAffine(layer.alpha, offset, SIZE), np.float32)
        picture *= (1 - 0.45 * _blurred(cast, 9.0))[..., None]
        picture *= (1 - layer.alpha)[..., None]
        picture += layer.colour
    picture *= _vignette()
    picture += _noise(frame)
    return np.clip(np.rint(picture, out=picture), 0, 255).astype(np.uint8)


def true_shape(frame: int) -> Array:
    """Where the points of `motion.grid()` are in a frame: (n, 3) mm in camera axes."""
    return surface(frame).points(grid()[0])


def project(points_mm: Array) -> Array:
    """Pixels (n, 2) of points (n, 3) in camera axes."""
    image = points_mm @ K.T
    return np.asarray(image[:, :2] / image[:, 2:], float)


def shading(sheet: Surface, xy_mm: Array) -> Array:
    """Light (n,) that sheet points (n, 2) send on, 1 = white paper facing the lamp at its mean distance."""
    to_lamp = _LAMP_MM - sheet.points(xy_mm)
    distance = np.linalg.norm(to_lamp, axis=1)
    facing = np.clip((to_lamp * sheet.normals(xy_mm)).sum(axis=1) / distance, 0, None)
    light = _AMBIENT + (1 - _AMBIENT) * facing * (_LAMP_REACH_MM / distance) ** 2
    return np.asarray(light, float)


def occluder(frame: int) -> Flags:
    """The pixels (480, 640) that the hand covers."""
    layer = hand_layer(frame, SIZE)
    return np.zeros(SIZE[::-1], bool) if layer is None else layer.alpha > 0.5


def sheet_at(sheet: Surface, x_px: Floats, y_px: Floats) -> tuple[Floats, Floats]:
    """Sheet coordinates x and y in mm, (h, w) each, seen at the columns (w,) and rows (h,).

    Where no sheet is seen they are far off its edges.
    """
    to_cylinder = sheet.axes.T @ np.linalg.inv(K)
    eye = -sheet.axes.T @ sheet.origin
    across, along, deep = (
        (row[0] * x_px[None, :] + (row[1] * y_px[:, None] + row[2])).astype(np.float32) for row in to_cylinder
    )
    table, first, step = _sight_table(sheet, eye)
    np.divide(across, deep, out=across)
    np.divide(along, deep, out=along)
    across -= first
    across /= step
    outside = (-1e6, -1e6, 0.0, 0.0)
    met = cv2.remap(table, across, np.zeros_like(across), cv2.INTER_LINEAR, borderValue=outside)
    arc, depth = met[..., 0], met[..., 1]
    along *= depth
    along += np.float32(eye[1])
    c, s = np.float32(np.cos(sheet.along_rad)), np.float32(np.sin(sheet.along_rad))
    return c * arc - s * along, s * arc + c * along


def _sight_table(sheet: Surface, eye: Array) -> tuple[Floats, float, float]:
    """For evenly spaced slopes of the line of sight: arc length where it first meets the sheet, and depth.

    (1, n, 2), with the slope of the first entry and the step between entries.
    """
    depth = sheet.curve[:, 1] - eye[2]
    slope = (sheet.curve[:, 0] - eye[0]) / depth
    wanted = np.linspace(slope.min(), slope.max(), _TABLE)
    nearest = np.full((_TABLE, 2), (-1e6, np.inf))
    turns = np.flatnonzero(np.diff(np.sign(np.diff(slope)))) + 1
    for begin, end in zip([0, *turns], [*turns, len(slope) - 1], strict=True):
        order = np.s_[begin : end + 1] if slope[end] > slope[begin] else np.s_[end : begin - 1 if begin else None : -1]
        seen = slope[order]
        deep = np.interp(wanted, seen, depth[order], left=np.inf, right=np.inf)
        nearer = deep < nearest[:, 1]
        arc = np.interp(wanted, seen, sheet.arc[order])
        nearest[nearer] = np.column_stack([arc, deep])[nearer]
    nearest[np.isinf(nearest[:, 1]), 1] = 0.0
    return nearest.astype(np.float32)[None], float(wanted[0]), float(wanted[1] - wanted[0])


def _cover(sheet: Surface) -> tuple[int, int, Floats]:
    """The lit sheet as filmed: left, top, and (h, w, 4) BGR·alpha with alpha, all 0 … 255."""
    edge = project(sheet.points(grid()[0]))
    left, top = np.clip(np.floor(edge.min(axis=0)).astype(int) - 3, 0, None)
    right, bottom = np.minimum(np.ceil(edge.max(axis=0)).astype(int) + 4, SIZE)
    # Sub-pixel centres: a pixel at c is the mean of c - 1/4 and c + 1/4 (for 2 x 2).
    finer = (np.arange((right - left) * _FINER) + 0.5) / _FINER - 0.5 + left
    finer_down = (np.arange((bottom - top) * _FINER) + 0.5) / _FINER - 0.5 + top
    x_mm, y_mm = sheet_at(sheet, finer.astype(np.float32), finer_down.astype(np.float32))
    for coordinate, extent in ((x_mm, WIDTH_MM), (y_mm, HEIGHT_MM)):
        coordinate += np.float32(extent / 2)
        coordinate *= np.float32(_PAGE_PX_PER_MM)
        coordinate -= np.float32(0.5)
    page = _lit_page(sheet)
    fine = cv2.remap(page, x_mm, y_mm, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=(0, 0, 0, 0))
    small = cv2.resize(fine, (right - left, bottom - top), interpolation=cv2.INTER_AREA)
    return int(left), int(top), small.astype(np.float32)


def _lit_page(sheet: Surface) -> NDArray[np.uint8]:
    """The printed page under the lamp, (h, w, 4) with full alpha."""
    columns, rows = 55, 39
    light = shading(sheet, grid(columns, rows)[0]).reshape(rows, columns).astype(np.float32)
    page = _page()
    # Nodes of the grid lie on the page's edges, samples of the page half a pixel inside.
    h, w = page.shape[:2]
    x = ((np.arange(w, dtype=np.float32) + 0.5) / w * (columns - 1))[None].repeat(h, axis=0)
    y = ((np.arange(h, dtype=np.float32) + 0.5) / h * (rows - 1))[:, None].repeat(w, axis=1)
    gain = cv2.remap(light, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    lit = cv2.multiply(page, cv2.merge([gain, gain, gain, np.ones_like(gain)]), dtype=cv2.CV_8U)
    return np.asarray(lit, np.uint8)


@cache
def _page() -> NDArray[np.uint8]:
    size = round(WIDTH_MM * _PAGE_PX_PER_MM), round(HEIGHT_MM * _PAGE_PX_PER_MM)
    small = cv2.resize(_drawn(PAGE), size, interpolation=cv2.INTER_AREA)
    return np.dstack([small, np.full(small.shape[:2], 255, np.uint8)])


@cache
def _ground() -> Floats:
    return _drawn(DESK).astype(np.float32)


def _drawn(path: Path) -> NDArray[np.uint8]:
    picture = cv2.imread(str(path))
    assert picture is not None, path
    return picture.astype(np.uint8)


def _shadow(sheet: Surface) -> Floats:
    """How much of the lamp the sheet takes from the desk, (480, 640) in 0 … 1."""
    coarse = 8
    border = np.concatenate([_edge(0.5), _edge(-0.5)[::-1]])
    outline = (project(sheet.points(border)) + np.array((26, 32))) / coarse
    mask = np.zeros((SIZE[1] // coarse, SIZE[0] // coarse), np.uint8)
    cv2.fillPoly(mask, [np.rint(outline * 16).astype(np.int32)], 255, cv2.LINE_AA, shift=4)
    soft = cv2.GaussianBlur(mask.astype(np.float32) / 255, (0, 0), 2.2)
    return np.asarray(cv2.resize(soft, SIZE, interpolation=cv2.INTER_CUBIC).clip(0, 1), np.float32)


def _edge(side: float) -> Array:
    x = np.linspace(-0.5, 0.5, 40) * WIDTH_MM
    return np.column_stack([x, np.full_like(x, side * HEIGHT_MM)])


def _blurred(mask: Floats, sigma: float) -> Floats:
    """A wide Gaussian blur, done on a quarter of the resolution."""
    small = cv2.resize(mask, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    soft = cv2.GaussianBlur(small, (0, 0), sigma / 4)
    return np.asarray(cv2.resize(soft, mask.shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)


@cache
def _vignette() -> Floats:
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float32)
    squared = ((x - SIZE[0] / 2) ** 2 + (y - SIZE[1] / 2) ** 2) / (SIZE[0] / 2) ** 2
    return np.asarray((1 - 0.09 * squared)[..., None], np.float32)


@cache
def _grain() -> Floats:
    """Noise of the sensor, a little larger than the picture on both sides."""
    rng = np.random.default_rng(3)
    return rng.normal(0, _NOISE, (SIZE[1] + 128, SIZE[0] + 128, 3)).astype(np.float32)


def _noise(frame: int) -> Floats:
    """Another cut-out of the same noise for every frame."""
    x, y = np.random.default_rng(frame).integers(0, 128, 2)
    return _grain()[y : y + SIZE[1], x : x + SIZE[0]]
