"""Pictures in memory that processes share: one writes them in a circle, another says which it has done with."""

import mmap
import os
import time

import numpy as np

from app.arrays import Image
from app.terminal.errors import UsageError

HEADER = 4096  # bytes before the first picture, with the count of those released
MOST_BYTES = 64 * 2**20
FEWEST, MOST = 6, 32  # pictures; tracking is up to two ahead of the recording's newest
PAUSE_S = 0.001
ENDLESS = np.iinfo(np.int64).max


class Ring:
    """The last pictures of a source, counted from 0.

    Args:
        file: number of the `shared_file`.
        size: (width, height) of each picture, px.

    Attributes:
        size: the same.
    """

    def __init__(self, file: int, size: tuple[int, int]) -> None:
        self.size = size
        width, height = size
        one = width * height * 3
        slots = int(np.clip(MOST_BYTES // one, FEWEST, MOST))
        try:
            os.ftruncate(file, HEADER + slots * one)  # new bytes are 0; again, nothing
            memory = mmap.mmap(file, HEADER + slots * one)
        except OSError as error:
            raise UsageError(f"no room for the pictures of processes ({error.strerror}): --jobs 1 needs none") from error
        self._released = np.frombuffer(memory, np.int64, 1)
        self._pictures = np.frombuffer(memory, np.uint8, offset=HEADER).reshape(slots, height, width, 3)
        self._parent = os.getppid()

    def write(self, number: int, picture: Image) -> None:
        """Write a picture (height, width, 3), once its place is free."""
        while number - len(self._pictures) >= self._released[0]:
            time.sleep(PAUSE_S)
            if os.getppid() != self._parent:  # nobody will release it
                os._exit(0)
        self._pictures[number % len(self._pictures)] = picture

    def picture(self, number: int) -> Image:
        """A picture; it does not change until it is released."""
        return self._pictures[number % len(self._pictures)]

    def release(self, number: int) -> None:
        """Give a picture, and those before, up."""
        self._released[0] = number + 1

    def release_all(self) -> None:
        """No picture will be needed any more."""
        self._released[0] = ENDLESS
