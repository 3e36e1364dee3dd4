"""A few frames of a recording, with mesh and points drawn over them, as one picture."""

import cv2
import numpy as np

from app.arrays import Image
from app.playback.overlay import overlaid
from app.playback.playback import Playback

COLUMNS, ROWS = 3, 2
WIDTH_PX = 480  # of one frame
QUALITY = 85


def strip(playback: Playback) -> bytes:
    """A JPEG of frames evenly spread over those that have a shape."""
    shaped = np.flatnonzero(np.isfinite(playback.estimates.s))
    chosen = set(shaped[np.linspace(0, len(shaped) - 1, COLUMNS * ROWS).round().astype(int)].tolist())
    pictures = [smaller(image) for row, image in overlaid(playback) if row in chosen]
    while len(pictures) < COLUMNS * ROWS:
        pictures.append(np.full_like(pictures[-1], 255))
    rows = [np.hstack(pictures[k * COLUMNS : (k + 1) * COLUMNS]) for k in range(ROWS)]
    return cv2.imencode(".jpg", np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])[1].tobytes()


def smaller(image: Image) -> Image:
    """As wide as a frame of the strip."""
    height = round(image.shape[0] * WIDTH_PX / image.shape[1])
    return np.asarray(cv2.resize(image, (WIDTH_PX, height), interpolation=cv2.INTER_AREA), np.uint8)
