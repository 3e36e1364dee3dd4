"""Rows of a recording: what of it is wanted, and what was found."""

from collections import defaultdict
from dataclasses import dataclass, field
from operator import attrgetter

STATIC = -1  # the frame of what belongs to no frame

Wanted = tuple[str, str]  # beginnings of an entity and of a component


@dataclass(frozen=True)
class Row:
    """One value of one component.

    Attributes:
        id: sorts in the order of logging.
        frame: number of the frame in its source; STATIC for static data.
        time_s: of the frame.
        value: an array (n, ...) of the row's instances; of texts and records a list; of a blob its bytes.
    """

    id: bytes
    frame: int
    time_s: float
    value: object


@dataclass
class Rows:
    """Rows by entity and component, in the order of logging."""

    found: dict[tuple[str, str], list[Row]] = field(default_factory=lambda: defaultdict(list))

    def all(self, entity: str, component: str) -> list[Row]:
        """Every row."""
        return sorted(self.found.get((entity, component), []), key=attrgetter("id"))

    def last(self, entity: str, component: str) -> dict[int, Row]:
        """By frame: of several rows of a frame the one that was logged last."""
        return {row.frame: row for row in self.all(entity, component)}

    def static(self, entity: str, component: str) -> object:
        """A static value.

        Raises:
            KeyError: there is none.
        """
        return self.last(entity, component)[STATIC].value
