"""Mapping while frames come: keyframes are kept, and looked at again whenever their views have grown."""

from collections.abc import Callable
from typing import Any

from reconstruction.arrays import Array, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.keyframes import Keyframes
from reconstruction.mapping.map import Map, map_of

FIRST_LOOK = 10  # keyframes taken before the first map; the next when there are twice as many, and so on
LATENCY = 90  # frames after which a map that was begun is in force, however fast the machine is

Result = Callable[[], Map | None]
Start = Callable[..., Result]
"""Begins a call (function, *arguments) somewhere, and returns what waits for its result."""


def at_once(function: Callable[..., Any], *arguments: object) -> Result:
    """A call made when its result is wanted."""
    return lambda: function(*arguments)


class Mapper:
    """Keyframes, and when to make a map of them.

    Args:
        start: where maps are made.

    Attributes:
        keyframes: so far.
    """

    def __init__(self, start: Start = at_once) -> None:
        self.keyframes = Keyframes()
        self._start = start
        self._next_look = FIRST_LOOK
        self._frame, self._due = -1, 0
        self._result: Result | None = None

    def add(self, W: Array, visible: Mask, camera: Camera, *, estimate_focal: bool) -> Map | None:
        """Take the next frame's points (2, p) px; a map, if one that was begun earlier is due now."""
        self._frame += 1
        self.keyframes.offer(self._frame, W, visible)
        if self._result is not None:
            if self._frame < self._due:
                return None
            result, self._result = self._result, None
            return result()
        if self.keyframes.version >= self._next_look:
            self._next_look = 2 * self.keyframes.version
            self._due = self._frame + LATENCY
            self._result = self._begin(camera, estimate_focal=estimate_focal)
        return None

    def finish(self, camera: Camera, *, estimate_focal: bool) -> Map | None:
        """The map of all keyframes, made now."""
        if self._result is not None:
            self._result()
        return self._begin(camera, estimate_focal=estimate_focal)()

    def _begin(self, camera: Camera, *, estimate_focal: bool) -> Result:
        W, visible, _ = self.keyframes.spread()
        return self._start(map_of, W, visible, camera, estimate_focal)
