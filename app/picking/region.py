"""What is drawn on the page, as options."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, cast

Kind = Literal["roi", "polygon", "corners"]
LEAST = {"roi": 2, "polygon": 3, "corners": 4}


@dataclass(frozen=True)
class Picked:
    """A region in a frame: a rectangle x, y, width, height, or corners x, y, x, y, …; px."""

    kind: Kind
    numbers: tuple[int, ...]
    frame: int

    @property
    def options(self) -> list[str]:
        """As `run` takes it."""
        frames = [] if self.frame == 0 else ["--frames", f"{self.frame}:"]
        return [*frames, f"--{self.kind}", *map(str, self.numbers)]


def picked(words: Mapping[str, Any]) -> Picked:
    """The region that a page tells: its kind, points [[x, y], …] and the frame's number.

    Raises:
        ValueError, KeyError, TypeError: it is none.
    """
    kind, points = words["kind"], [(int(x), int(y)) for x, y in words["points"]]
    if kind not in LEAST or len(points) < LEAST[kind] or (kind != "polygon" and len(points) > LEAST[kind]):
        raise ValueError(f"{len(points)} points are no {kind}")
    if kind != "roi":
        return Picked(cast(Kind, kind), tuple(value for point in points for value in point), int(words["number"]))
    (a, b), (c, d) = points
    x, y = min(a, c), min(b, d)
    return Picked("roi", (x, y, max(a, c) - x, max(b, d) - y), int(words["number"]))
