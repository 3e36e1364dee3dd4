"""A forearm with a hand that once reaches over the sheet and withdraws."""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from scipy.interpolate import PchipInterpolator

from app.arrays import Array, Floats

FIRST_FRAME, LAST_FRAME = 196, 238
"""The hand is in the picture in these frames at most."""

_CANVAS = (300, 760)
_ANCHOR = (150.0, 150.0)
# Tapered limbs on the canvas, fingers up: x, y, radius at one end, then at the other.
_SKIN = np.array(
    [
        (150, 330, 36, 152, 700, 54),
        (150, 205, 42, 150, 320, 37),
        (128, 168, 24, 168, 168, 26),
        (116, 172, 16, 99, 66, 10.5),
        (140, 160, 16.5, 134, 38, 11),
        (166, 160, 16, 170, 44, 10.5),
        (188, 174, 14, 204, 82, 9),
        (118, 236, 20, 70, 168, 12.5),
    ],
    float,
)
_SLEEVE = np.array([(151, 388, 50, 152, 760, 76)], float)
_NAILS = ((99, 62, 99), (134, 34, 94), (170, 40, 88), (205, 78, 76))

# frame; where the middle of the palm is, in pixels; turn of the arm in degrees, anticlockwise.
_PATH = np.array(
    [
        (FIRST_FRAME, 790, 640, 38),
        (204, 560, 440, 34),
        (210, 452, 318, 26),
        (217, 418, 268, 16),
        (224, 392, 280, 4),
        (230, 380, 400, -4),
        (LAST_FRAME, 372, 700, -8),
    ],
    float,
)


@dataclass(frozen=True)
class Layer:
    """A picture to be put over another."""

    colour: Floats
    """(h, w, 3) BGR, 0 … 255, already multiplied by alpha."""
    alpha: Floats
    """(h, w), 0 … 1, the share of each pixel that is covered."""


def hand_layer(frame: int, size: tuple[int, int]) -> Layer | None:
    """The hand in a frame, in a picture of `size` (width, height); None when it is out of sight."""
    if not FIRST_FRAME <= frame <= LAST_FRAME:
        return None
    x, y, turn = _path()(frame)
    place = cv2.getRotationMatrix2D(_ANCHOR, float(turn), 1.0)
    place[:, 2] += (x - _ANCHOR[0], y - _ANCHOR[1])
    layer = cv2.warpAffine(_sprite(), place, size, flags=cv2.INTER_LINEAR, borderValue=(0, 0, 0, 0))
    if not layer[..., 3].any():
        return None
    return Layer(np.asarray(layer[..., :3], np.float32), np.asarray(layer[..., 3], np.float32))


@cache
def _path() -> PchipInterpolator:
    return PchipInterpolator(_PATH[:, 0], _PATH[:, 1:])


@cache
def _sprite() -> Floats:
    """The arm on its own canvas, (h, w, 4) premultiplied BGR and alpha, lit from the top left."""
    distance, height = _limbs(_SKIN, softness=7.0)
    sleeve_distance, sleeve_height = _limbs(_SLEEVE, softness=1.0)
    rng = np.random.default_rng(5)
    mottle = cv2.GaussianBlur(rng.normal(0, 1, distance.shape).astype(np.float32), (0, 0), 5)
    skin = np.array((122, 152, 208), np.float32) * (1 + 0.35 * mottle[..., None])
    for x, y, turn in _NAILS:
        cv2.ellipse(skin, (x, y), (7, 5), turn, 0, 360, (150, 176, 226), -1, cv2.LINE_AA)
    for x, y in (
        (112, 116),
        (136, 98),
        (169, 100),
        (196, 126),
        (120, 180),
        (146, 172),
        (168, 174),
        (186, 184),
    ):
        cv2.ellipse(skin, (x, y), (7, 1), 4, 0, 360, (104, 130, 186), 1, cv2.LINE_AA)
    skin = cv2.GaussianBlur(skin, (0, 0), 1.0)
    folds = cv2.GaussianBlur(rng.normal(0, 1, distance.shape).astype(np.float32), (0, 0), sigmaX=16, sigmaY=5)
    cloth = np.array((132, 92, 58), np.float32) * (1 + 5 * folds[..., None])
    worn = _cover(sleeve_distance)[..., None]
    colour = skin * _light(height)[..., None] * (1 - worn) + cloth * _light(sleeve_height)[..., None] * worn
    alpha = np.maximum(_cover(distance), worn[..., 0])
    colour = np.clip(colour, 0, 255) * alpha[..., None]
    sprite: Floats = np.dstack([colour, alpha]).astype(np.float32)
    return np.asarray(cv2.GaussianBlur(sprite, (0, 0), 0.8), np.float32)


def _limbs(limbs: Array, softness: float) -> tuple[Floats, Floats]:
    """Signed distance to the union of the limbs (negative inside), and their height above the paper, px."""
    width, height = _CANVAS
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    shrunk = np.zeros((height, width), np.float32)
    raised = np.zeros((height, width), np.float32)
    for ax, ay, ar, bx, by, br in limbs:
        dx, dy = bx - ax, by - ay
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
        radius = ar + along * (br - ar)
        gap = np.hypot(x - ax - along * dx, y - ay - along * dy)
        shrunk += np.exp((radius - gap).clip(-200, 60) / softness)
        raised = np.maximum(raised, np.sqrt(np.clip(radius**2 - gap**2, 0, None)))
    soft = cv2.GaussianBlur(raised, (0, 0), 2.2)
    return np.asarray(-softness * np.log(shrunk + 1e-20), np.float32), np.asarray(soft, np.float32)


def _cover(distance: Floats) -> Floats:
    return np.asarray(np.clip(0.5 - distance, 0, 1), np.float32)


def _light(height: Floats) -> Floats:
    """Lambert shading of a height field, soft."""
    slope_y, slope_x = np.gradient(cv2.GaussianBlur(height, (0, 0), 1.5))
    facing = (1 + 0.45 * slope_x + 0.55 * slope_y) / np.sqrt(1 + slope_x**2 + slope_y**2)
    return np.asarray(np.clip(0.42 + 0.6 * facing, 0.2, 1.25), np.float32)
