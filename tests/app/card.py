"""A picture to paint."""

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def card() -> Image:
    """A test card: coloured squares, a disc, a word."""
    y, x = np.mgrid[:420, :594]
    hue = np.dstack([x / 594 * 179, np.full(x.shape, 150.0), np.full(x.shape, 230.0)]).astype(np.uint8)
    squares = ((x // 33 + y // 35) % 2)[..., None] > 0
    image = np.where(squares, cv2.cvtColor(hue, cv2.COLOR_HSV2BGR), 250).astype(np.uint8)
    cv2.circle(image, (297, 210), 110, (40, 40, 200), -1, cv2.LINE_AA)
    cv2.putText(image, "MODE", (215, 225), cv2.FONT_HERSHEY_SIMPLEX, 1.8, (255, 255, 255), 6, cv2.LINE_AA)
    return image
