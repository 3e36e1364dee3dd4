"""Numbered image files as a video."""

import re
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from tracking import Image, TrackingError


class ImageFiles:
    """The files of a printf pattern in the order of their numbers, which may start anywhere and have gaps.

    Reads like a cv2.VideoCapture, but goes on past files that are missing or damaged.

    Raises:
        TrackingError: the pattern has no number in the file's name, or no file matches.
    """

    def __init__(self, pattern: str) -> None:
        path = Path(pattern)
        name = re.fullmatch(r"(.*?)%0?(\d*)d(.*)", path.name)
        if name is None:
            raise TrackingError(f"{pattern}: give the number of the image once in the file's name, as img%04d.png")
        before, _, after = name.groups()
        numbered = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
        found: list[tuple[int, Path]] = []
        if path.parent.is_dir():
            matches = ((numbered.fullmatch(file.name), file) for file in path.parent.iterdir())
            found = [(int(m[1]), file) for m, file in matches if m and path.name % int(m[1]) == file.name]
        if not found:
            raise TrackingError(f"no image file matches {pattern}; the number stands for the frame, as in img%04d.png")
        self._files = [file for _, file in sorted(found)]
        self._next = 0

    def grab(self) -> bool:
        """Go to the next file; False after the last."""
        self._next += 1
        return self._next <= len(self._files)

    def retrieve(self) -> tuple[bool, Image]:
        """Decode the file gone to as BGR: whether it could be, and the picture."""
        encoded = np.fromfile(self._files[self._next - 1], np.uint8)
        image = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if encoded.size else None
        return image is not None, cast(Image, image)

    def get(self, propId: int, /) -> float:
        """The number of files for CAP_PROP_FRAME_COUNT; 0, unknown, for any other property."""
        return float(len(self._files)) if propId == cv2.CAP_PROP_FRAME_COUNT else 0.0

    def release(self) -> None:
        """End the sequence."""
        self._next = len(self._files)
