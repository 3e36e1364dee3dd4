"""Video in, point observations out: frames, corners, pyramidal LK, consistency, W^f and h^f."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]
Image = NDArray[np.uint8]  # (H, W, 3) BGR, or (H, W) gray levels or a mask


class TrackingError(ValueError):
    """A video, region or track file that cannot be used; the message says what is wrong and what is needed.

    Args:
        text: the message.
        about: what it is about: truth, frames or drop_late; empty for anything else.
    """

    def __init__(self, text: str, about: str = "") -> None:
        super().__init__(text)
        self.about = about
