"""Pictures that are not sharp, as a camera that is shaken or still finds its focus makes them."""

import cv2
import numpy as np

from app.arrays import Image
from app.footage.clip import Change


def shaken_at_first(px: float, frames: int, direction: float = 0.5) -> Change:
    """Blurred along a direction (radians) by so many pixels at first, sharp after so many frames."""

    def change(_: object, frame: int, image: Image) -> Image:
        way = px * (1 - frame / frames)
        if way < 1:
            return image
        size = int(np.ceil(way)) | 1
        steps = np.linspace(-way / 2, way / 2, 8 * size)
        x, y = (np.rint(steps * part + size // 2).astype(int) for part in (np.cos(direction), np.sin(direction)))
        kernel = np.zeros((size, size), np.float32)
        np.add.at(kernel, (y, x), 1.0 / len(steps))
        return np.asarray(cv2.filter2D(image, -1, kernel), np.uint8)

    return change


def focusing(px: float, frames: int) -> Change:
    """Out of focus by so many pixels (standard deviation) at first, sharp after so many frames."""

    def change(_: object, frame: int, image: Image) -> Image:
        deviation = px * (1 - frame / frames)
        return image if deviation < 0.3 else np.asarray(cv2.GaussianBlur(image, (0, 0), deviation), np.uint8)

    return change
