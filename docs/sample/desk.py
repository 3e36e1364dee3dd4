"""What lies behind the sheet: a wooden desk with a few things on it, out of focus."""

import cv2
import numpy as np
from numpy.typing import NDArray


def desk(size: tuple[int, int]) -> NDArray[np.uint8]:
    """The desk as filmed without a sheet, (height, width, 3) BGR."""
    width, height = size
    rng = np.random.default_rng(11)
    down, across = np.mgrid[0:height, 0:width].astype(np.float32)
    grain = np.zeros((height, width), np.float32)
    for stretch, weight in ((90, 0.5), (30, 0.3), (10, 0.2)):
        noise = rng.normal(0, 1, (height, width // stretch + 2)).astype(np.float32)
        soft = cv2.GaussianBlur(noise, (0, 0), sigmaX=0.6, sigmaY=200 / stretch / 3)
        grain += weight * cv2.resize(soft / soft.std(), (width, height), interpolation=cv2.INTER_CUBIC)
    grain += 0.5 * np.sin((down + 10 * np.sin(across / 170) + 4 * grain) / 9)
    board = np.floor((down + 26) / 118)
    tone = 1 + 0.055 * grain + 0.05 * np.sin(2.4 * board + 1)
    tone[np.abs((down + 26) % 118) < 1.6] = 0.62
    picture = np.clip(tone[..., None] * np.array((70, 106, 148), np.float32), 0, 255).astype(np.uint8)
    picture = _things(picture)
    picture = cv2.GaussianBlur(picture, (0, 0), 2.6)
    light = 1.1 - 0.00034 * across - 0.00052 * down
    return np.asarray(np.clip(picture * light[..., None], 0, 255), np.uint8)


def _things(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Put a mug, a notebook and a pencil on the desk, each over its shadow."""
    mug = (66, 82)
    notebook = cv2.boxPoints(((596, 92), (150, 190), 14)).astype(np.int32)
    pencil = cv2.boxPoints(((86, 414), (170, 9), -24)).astype(np.int32)
    shadow = np.zeros(picture.shape[:2], np.uint8)
    cv2.circle(shadow, (mug[0] + 12, mug[1] + 16), 54, 150, -1)
    cv2.fillPoly(shadow, [notebook + np.array((8, 9)), pencil + np.array((4, 6))], 130)
    dark = 1 - cv2.GaussianBlur(shadow, (0, 0), 7).astype(np.float32) / 255
    picture = np.clip(picture * dark[..., None], 0, 255).astype(np.uint8)
    cv2.fillPoly(picture, [notebook], (96, 62, 40))
    spine = np.array([notebook[0] * 0.92 + notebook[3] * 0.08, notebook[1] * 0.92 + notebook[2] * 0.08])
    cv2.polylines(picture, [spine.astype(np.int32)], False, (170, 150, 130), 4)
    cv2.fillPoly(picture, [pencil], (40, 170, 226))
    cv2.ellipse(picture, (mug[0] - 44, mug[1] + 40), (24, 17), -45, 0, 360, (205, 212, 214), 9)
    cv2.circle(picture, mug, 54, (212, 218, 220), -1)
    cv2.circle(picture, mug, 46, (160, 168, 172), -1)
    cv2.circle(picture, (mug[0] + 2, mug[1] + 3), 43, (26, 40, 58), -1)
    cv2.ellipse(picture, (mug[0] - 10, mug[1] - 14), (20, 8), -30, 0, 360, (50, 74, 100), -1)
    return picture
