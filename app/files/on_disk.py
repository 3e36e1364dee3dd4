"""Things by number in a temporary file: memory does not grow with them."""

import pickle
from collections.abc import Iterator
from io import BytesIO
from tempfile import TemporaryFile
from typing import Any, Generic, TypeVar, cast

from app.numbered import Numbered

T = TypeVar("T")


class OnDisk(Generic[T]):
    """Things that are added, replaced, and taken once; pickled.

    Args:
        shared: types of their parts that many have in common; these stay in memory.
    """

    def __init__(self, *shared: type) -> None:
        self._shared = shared
        self._parts: list[object] = []
        self._file = TemporaryFile()  # noqa: SIM115 (goes when this object goes)
        self._places = Numbered()  # in the file

    def add(self, number: int, thing: T) -> None:
        """Keep a thing; another one of that number is forgotten.

        Raises:
            OSError: the disk is full.
        """
        buffer = BytesIO()
        pickler = pickle.Pickler(buffer, protocol=5)
        pickler.persistent_id = self._number_of  # type: ignore[method-assign]
        pickler.dump(thing)
        self._places[number] = self._file.seek(0, 2)
        self._file.write(buffer.getbuffer())

    def forget(self, number: int) -> None:
        """It is not wanted any more, if it is there."""
        self._places.forget(number)

    def __getitem__(self, number: int) -> T:
        self._file.seek(int(self._places[number]))
        unpickler = pickle.Unpickler(self._file)
        unpickler.persistent_load = self._parts.__getitem__  # type: ignore[method-assign]
        return cast(T, unpickler.load())

    def taken(self) -> Iterator[tuple[int, T]]:
        """All that are left, by their numbers; each is forgotten."""
        for number in self._places:
            yield number, self[number]
            self.forget(number)

    def _number_of(self, part: Any) -> int | None:
        """Of a part that stays in memory; None for the others."""
        if not isinstance(part, self._shared):
            return None
        for number, one in enumerate(self._parts):
            if one is part:
                return number
        self._parts.append(part)
        return len(self._parts) - 1
