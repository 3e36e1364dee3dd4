"""Numbered image files as a video."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from tracking import Image, TrackingError

FEW_MISSING = 0.1  # of the numbers: where more are, they do not count frames
LONGEST_GAP = 20  # of them in a row
NAMED = 10  # that are told one by one


class ImageFiles:
    """The files of a printf pattern in the order of their numbers, which may start anywhere and go in steps.

    Reads like a cv2.VideoCapture, but goes on past files that are damaged, or missing: their frames cannot be decoded.

    Args:
        pattern: with the number once in the file's name.
        log: told which numbers are missing.

    Raises:
        TrackingError: the pattern has no number in the file's name, or no file matches.
    """

    def __init__(self, pattern: str, log: Callable[[str], None] = lambda _: None) -> None:
        path = Path(pattern)
        name = re.fullmatch(r"(.*?)(%0?\d*d)(.*)", path.name)
        if name is None:
            raise TrackingError(f"{pattern}: give the number of the image once in the file's name, as img%04d.png")
        before, number, after = name.groups()
        numbered = re.compile(re.escape(before) + r"(\d+)" + re.escape(after))
        found: list[tuple[int, Path]] = []
        if path.parent.is_dir():
            matches = ((numbered.fullmatch(file.name), file) for file in path.parent.iterdir())
            found = [(int(m[1]), file) for m, file in matches if m and number % int(m[1]) == m[1]]
        if not found:
            raise TrackingError(f"no image file matches {pattern}; the number stands for the frame, as in img%04d.png")
        files = dict(sorted(found))
        missing = missing_numbers(list(files))
        if missing:
            named = ", ".join(map(str, missing[:NAMED])) + (", …" if len(missing) > NAMED else "")
            log(f"missing of the images {path.name}: number {named}; those frames are left out")
        self._files = [files.get(number) for number in sorted([*files, *missing])]
        self._next = 0

    def grab(self) -> bool:
        """Go to the next file; False after the last."""
        self._next += 1
        return self._next <= len(self._files)

    def retrieve(self) -> tuple[bool, Image]:
        """Decode the file gone to as BGR: whether it could be, and the picture."""
        file = self._files[self._next - 1]
        encoded = np.fromfile(file, np.uint8) if file else np.zeros(0, np.uint8)
        image = cv2.imdecode(encoded, cv2.IMREAD_COLOR) if encoded.size else None
        return image is not None, cast(Image, image)

    def get(self, propId: int, /) -> float:
        """The number of files for CAP_PROP_FRAME_COUNT; 0, unknown, for any other property."""
        return float(len(self._files)) if propId == cv2.CAP_PROP_FRAME_COUNT else 0.0

    def release(self) -> None:
        """End the sequence."""
        self._next = len(self._files)


def missing_numbers(numbers: Sequence[int]) -> list[int]:
    """What is missing in ascending numbers that go in usual steps; nothing where they do not count frames."""
    if len(numbers) < 2:
        return []
    step = int(np.median(np.diff(numbers)))
    all_of_them = range(numbers[0], numbers[-1] + 1, step)
    longest = int(np.diff(numbers).max()) // step - 1
    if len(all_of_them) - len(numbers) > FEW_MISSING * len(all_of_them) or longest > LONGEST_GAP:
        return []
    missing = sorted(set(all_of_them) - set(numbers))
    return missing if len(missing) == len(all_of_them) - len(numbers) else []
