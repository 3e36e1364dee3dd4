"""Numbers by frame, in eight bytes each."""

from array import array
from collections.abc import Iterator
from math import isnan, nan


class Numbered:
    """What a dictionary of floats by whole numbers from 0 on is, but an hour of frames does not fill the memory."""

    def __init__(self) -> None:
        self._values = array("d")

    def __setitem__(self, number: int, value: float) -> None:
        self._values.extend([nan] * (number + 1 - len(self._values)))
        self._values[number] = value

    def __contains__(self, number: int) -> bool:
        return number < len(self._values) and not isnan(self._values[number])

    def __getitem__(self, number: int) -> float:
        if number not in self:
            raise KeyError(number)
        return self._values[number]

    def forget(self, number: int) -> None:
        """Nothing is known of it any more."""
        if number in self:
            self._values[number] = nan

    def __iter__(self) -> Iterator[int]:
        """Those of which something is known, ascending; some may be forgotten meanwhile."""
        return (number for number in range(len(self._values)) if number in self)
