"""How the sheet moves: turned flat for two seconds, then bent and waved along slowly changing directions.

At every instant the sheet is a generalised cylinder: straight along one direction of the page, and along the
other a curve found by integrating its tangent angle over arc length. So it bends but cannot stretch.
Lengths are millimetres. Sheet coordinates: x right, y down from the sheet's centre; camera axes: x right,
y down, z forward.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from app.arrays import Array, Indices

WIDTH_MM, HEIGHT_MM = 297.0, 210.0
"""The sheet: A4, lying."""

FRAMES = 300
FPS = 30.0
RIGID_FRAMES = 60
"""The sheet is flat in frames 0 … RIGID_FRAMES - 1."""

_WAVELENGTH_MM = 260.0
_STEP_MM = 0.25
_OVERHANG_MM = 12.0

# One row per key frame; in between a monotone cubic, so that zero stays exactly zero between two zeros.
# yaw, pitch, roll: degrees about the camera's y, x, z axes.   x, y, z: the sheet's middle in mm.
# along: the direction on the page, in degrees from its x axis, in which the sheet is curved.
# bend: turn of the tangent from middle to edge; wave: its largest slope, both in degrees; phase: in turns.
_KEYS = np.array(
    [
        # frame yaw pitch roll   x    y    z  along bend wave phase
        (0, -7, 5, -2, -4, 2, 505, 20, 0, 0, 0.00),
        (14, -21, -4, -1, 2, 0, 500, 20, 0, 0, 0.00),
        (26, -8, -17, 1, 8, -4, 495, 20, 0, 0, 0.00),
        (40, 17, -4, 2, 6, 2, 500, 20, 0, 0, 0.00),
        (52, 14, 15, 2, 0, 4, 505, 20, 0, 0, 0.00),
        (60, 6, 13, 1, -2, 4, 505, 20, 0, 0, 0.00),
        (90, -10, 6, -2, -6, 0, 505, 12, 30, 6, 0.10),
        (120, 6, -10, -4, 0, -4, 500, 4, -20, 24, 0.60),
        (150, 14, 4, 0, 6, 2, 500, -14, -34, 16, 1.20),
        (180, -6, 10, 4, 0, 4, 505, -34, -16, 34, 1.80),
        (210, -11, -2, 2, -6, 0, 505, -50, 18, 17, 2.30),
        (240, 4, -6, -2, 0, -4, 500, -66, 32, 8, 2.80),
        (270, 14, 4, -3, 6, 2, 500, -40, -14, 30, 3.40),
        (299, -4, 10, 0, 0, 2, 505, -16, -36, 12, 3.90),
    ],
    float,
)


@dataclass(frozen=True)
class Surface:
    """The sheet at one instant."""

    axes: Array
    """(3, 3) columns in camera axes: across the rulings, along them, and the flat sheet's normal, forward."""
    origin: Array
    """(3,) mm, the mean of the curve between the sheet's edges, in camera axes."""
    along_rad: float
    """The page direction across the rulings, from the page's x axis towards its y axis."""
    arc: Array
    """(n,) mm, arc length across the rulings from the sheet's centre, evenly spaced, past the edges."""
    curve: Array
    """(n, 2) mm, the curved cross-section: along axes[:, 0] and axes[:, 2]."""
    slope_rad: Array
    """(n,) the curve's tangent angle."""

    def points(self, xy_mm: Array) -> Array:
        """Camera coordinates (n, 3) of sheet points (n, 2)."""
        across, along = self._split(xy_mm)
        local = np.stack(
            [
                np.interp(across, self.arc, self.curve[:, 0]),
                along,
                np.interp(across, self.arc, self.curve[:, 1]),
            ]
        )
        return (self.axes @ local).T + self.origin

    def normals(self, xy_mm: Array) -> Array:
        """Unit normals (n, 3) towards the camera's side of the page, at sheet points (n, 2)."""
        across, _ = self._split(xy_mm)
        slope = np.interp(across, self.arc, self.slope_rad)
        normals = self.axes @ np.stack([np.sin(slope), np.zeros_like(slope), -np.cos(slope)])
        return np.asarray(normals.T, float)

    def _split(self, xy_mm: Array) -> tuple[Array, Array]:
        c, s = np.cos(self.along_rad), np.sin(self.along_rad)
        return xy_mm @ (c, s), xy_mm @ (-s, c)


def surface(frame: int) -> Surface:
    """The sheet in a frame; frames outside 0 … FRAMES - 1 continue the first and the last one."""
    yaw, pitch, roll, x, y, z, along, bend, wave, phase = _keyed()(np.clip(frame, 0, FRAMES - 1))
    along_rad = np.deg2rad(along)
    reach = 0.5 * (WIDTH_MM * abs(np.cos(along_rad)) + HEIGHT_MM * abs(np.sin(along_rad)))
    count = 2 * int((reach + _OVERHANG_MM) / _STEP_MM) + 1
    arc = np.asarray((np.arange(count) - count // 2) * _STEP_MM, float)
    slope = np.asarray(np.deg2rad(bend) * arc / reach, float)
    slope += np.deg2rad(wave) * np.sin(2 * np.pi * (arc / _WAVELENGTH_MM - phase))
    inside = np.abs(arc) <= reach
    slope -= slope[inside].mean()
    middle = 0.5 * (slope[1:] + slope[:-1])
    steps = np.column_stack([np.cos(middle), np.sin(middle)]) * _STEP_MM
    curve = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    curve -= curve[inside].mean(axis=0)
    turned = _turn(np.deg2rad(yaw), np.deg2rad(pitch), np.deg2rad(roll))
    c, s = np.cos(along_rad), np.sin(along_rad)
    page = np.array([(c, -s, 0), (s, c, 0), (0, 0, 1)])
    return Surface(turned @ page, np.array([x, y, z]), float(along_rad), arc, curve, slope)


def grid(columns: int = 27, rows: int = 19) -> tuple[Array, Indices]:
    """Sheet points (columns·rows, 2) in mm, row by row, and triangles (m, 3) that cover the sheet."""
    x = np.linspace(-0.5, 0.5, columns) * WIDTH_MM
    y = np.linspace(-0.5, 0.5, rows) * HEIGHT_MM
    xy_mm = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    index = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return xy_mm, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


@cache
def _keyed() -> PchipInterpolator:
    return PchipInterpolator(_KEYS[:, 0], _KEYS[:, 1:])


def _turn(yaw: float, pitch: float, roll: float) -> Array:
    """Rotation (3, 3): roll in the page first, then pitch, then yaw."""
    cy, sy, cp, sp, cr, sr = (f(angle) for angle in (yaw, pitch, roll) for f in (np.cos, np.sin))
    about_y = np.array([(cy, 0, sy), (0, 1, 0), (-sy, 0, cy)])
    about_x = np.array([(1, 0, 0), (0, cp, -sp), (0, sp, cp)])
    about_z = np.array([(cr, -sr, 0), (sr, cr, 0), (0, 0, 1)])
    return np.asarray(about_y @ about_x @ about_z, float)
