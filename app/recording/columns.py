"""Rows of a recording, gathered over some frames and written as columns: few large pieces instead of many small ones."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
import rerun as rr
from numpy.typing import NDArray

from app.arrays import Array
from app.recording import entities

Values: TypeAlias = NDArray[Any] | pa.Array | list[str]
"""The instances of one component in one row, along the first axis."""

Kind = Callable[..., rr.ComponentColumnList]
"""What makes columns of components by name: `columns` of one of Rerun's archetypes, or `ours`."""


@cache
def ours(archetype: str) -> Kind:
    """Components of our own, at full precision; viewers do not draw them, programs read them."""
    archetype_name = f"{entities.APPLICATION}.{archetype}"

    def columns(**components: Values) -> rr.ComponentColumnList:
        arrays = {name: pa.array(values) for name, values in components.items()}  # Rerun would go number by number
        return rr.DynamicArchetype.columns(archetype_name, components=arrays)

    return columns


@dataclass(frozen=True)
class Piece:
    """Some rows of an entity."""

    entity: str
    times: list[rr.TimeColumn]
    columns: list[rr.ComponentColumn]


class Columns:
    """The rows that are not written yet.

    Attributes:
        rows: of the entity that has the most.
    """

    def __init__(self) -> None:
        self.rows = 0
        self._waiting: dict[tuple[str, Kind, tuple[str, ...]], list[tuple[int, float, tuple[Values, ...]]]] = {}

    def add(self, entity: str, kind: Kind, frame: int, time_s: float, values: dict[str, Values]) -> None:
        """One row: what is known of an entity in a frame."""
        waiting = self._waiting.setdefault((entity, kind, tuple(values)), [])
        waiting.append((frame, time_s, tuple(values.values())))
        self.rows = max(self.rows, len(waiting))

    def taken(self) -> Iterator[Piece]:
        """All rows, each once, those of an entity in the order in which they came."""
        waiting, self._waiting, self.rows = self._waiting, {}, 0
        for (entity, kind, names), rows in waiting.items():
            frames, seconds, values = zip(*rows, strict=True)
            columns = [
                column
                for name, of_rows in zip(names, zip(*values, strict=True), strict=True)
                for column in kind(**{name: joined(of_rows)}).partition([len(value) for value in of_rows])
            ]
            yield Piece(entity, time_columns(frames, np.array(seconds)), columns)


def time_columns(frames: tuple[int, ...], seconds: Array) -> list[rr.TimeColumn]:
    """Both timelines."""
    nanoseconds = np.rint(seconds * 1e9).astype("timedelta64[ns]")
    return [rr.TimeColumn(entities.FRAME, sequence=frames), rr.TimeColumn(entities.TIME, duration=nanoseconds)]


def joined(values: tuple[Values, ...]) -> Values:
    """One after another."""
    if isinstance(values[0], list):
        return [text for texts in values for text in texts]
    return np.concatenate(values) if isinstance(values[0], np.ndarray) else pa.concat_arrays(values)
