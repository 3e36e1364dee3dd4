"""Following a run while it goes on: frames are handed on in order, each once its shape is known."""

from collections import deque
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from reconstruction.window.model import Model, ShapeEstimate
from tracking.klt import Observation
from tracking.video import Frame


class Observer(Protocol):
    """Somebody who follows a run, frame by frame and in order, as soon as there are shapes."""

    def begin(self, first: Frame, points_px: NDArray[np.float64], model: Model, fps: float) -> None:
        """The first frame, the vertices (p, 2) px in it, the model, and the announced rate of the video.

        Called again when another object is followed: the frames from then on are of that one, its first frame was before.
        """

    def frame(self, frame: Frame, observation: Observation, estimate: ShapeEstimate | None) -> None:
        """A frame and what is known of it."""


class Followed:
    """Frames that wait for their shapes.

    Args:
        observer: who gets them; None drops them.
    """

    def __init__(self, observer: Observer | None) -> None:
        self._observer = observer
        self._waiting: deque[tuple[Frame, Observation]] = deque()

    def add(self, frame: Frame, observation: Observation) -> None:
        """A frame that has no shape yet."""
        if self._observer is not None:
            self._waiting.append((frame, observation))

    def shape(self, index: int, estimate: ShapeEstimate) -> None:
        """The shape of the frame of that index; those before it will have none."""
        while self._waiting and self._waiting[0][0].index <= index:
            self._hand_on(estimate if self._waiting[0][0].index == index else None)

    def end(self) -> None:
        """No more shapes."""
        while self._waiting:
            self._hand_on(None)

    def _hand_on(self, estimate: ShapeEstimate | None) -> None:
        assert self._observer is not None
        self._observer.frame(*self._waiting.popleft(), estimate)
