"""Shapes of a sheet in frames to come, most of them made elsewhere while those before them have their turn."""

from collections import deque
from concurrent.futures import Future

from reconstruction.arrays import Array, Mask
from reconstruction.mapping.isometric.one_frame import Foreseen
from reconstruction.mapping.map import Map
from reconstruction.mapping.start import Start, at_once

ELSEWHERE = 0.75  # of the frames: the others' shapes are made here, which would only wait


class Foresight:
    """What is foreseen, in the frames' order.

    Args:
        start: where most of it is made.
    """

    def __init__(self, start: Start) -> None:
        self._start = start
        self._begun = deque["Future[list[Foreseen | None]]"]()
        self._made = deque[Foreseen | None]()

    def begin(self, known: Map, frames: list[tuple[Array, Mask]]) -> None:
        """Begin with the next frames, points (2, p) px with visibility (p,), by what is known of the object."""
        if known.sheet is not None:
            theirs = round(ELSEWHERE * len(frames))
            self._begun.append(self._start(known.foreseen, frames[:theirs]))
            self._begun.append(at_once(known.foreseen, frames[theirs:]))

    def next(self) -> Foreseen | None:
        """Of the next frame, if it was begun."""
        while not self._made and self._begun:  # there may be chunks without a frame
            self._made.extend(self._begun.popleft().result())
        return self._made.popleft() if self._made else None
