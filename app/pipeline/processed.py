"""What a run gives, frame by frame: in the source's order, each frame once its shape is known."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

from app.arrays import Array, Image
from reconstruction.basis.model import Model
from reconstruction.estimate import ShapeEstimate
from reconstruction.settings import Metric
from tracking.observation import Observation
from tracking.video import Frame

MOST_BYTES = 400 * 2**20  # of pictures that wait for shapes


@dataclass(frozen=True)
class FrameShape:
    """The shape of a frame of the source."""

    index: int
    time_s: float
    estimate: ShapeEstimate


@dataclass(frozen=True, eq=False)
class Surface:
    """What is followed, once it has a model.

    Attributes:
        first: the frame it was first seen in.
        points_px: (P, 2) its vertices in that frame.
        model: rest shape, mesh, modes and camera.
        metric: the dissimilarity its modes come from.
        texture_bgr: (H, W, 3) the first frame, with a texture painted on it if one was asked for.
    """

    first: Frame
    points_px: Array
    model: Model
    metric: Metric
    texture_bgr: Image

    @property
    def recorded(self) -> tuple[object, ...]:
        """What `Recording.rest` takes."""
        return self.model.basis, self.model.mesh, self.model.camera, self.texture_bgr, self.points_px


@dataclass(frozen=True, eq=False)
class Processed:
    """A frame and what is known of it.

    Attributes:
        frame: the picture, its number and its time.
        observation: the points tracked in it.
        estimate: its shape; None where the surface was lost, never had a model, or had to be waited for too long.
        surface: what the estimate is of: the same object until another surface is followed; None before there is a model.
    """

    frame: Frame
    observation: Observation
    estimate: ShapeEstimate | None
    surface: Surface | None


class InOrder:
    """Frames that wait for their shapes, and those that are ready.

    Attributes:
        wanted: whether anybody wants them; else none is kept.
    """

    def __init__(self) -> None:
        self.wanted = True
        self._waiting: deque[tuple[Frame, Observation]] = deque()
        self._ready: deque[Processed] = deque()

    def add(self, frame: Frame, observation: Observation) -> None:
        """A frame that has no shape yet."""
        if not self.wanted:
            return
        self._waiting.append((frame, observation))
        while len(self._waiting) * frame.image.nbytes > MOST_BYTES:  # lost in its start, it may be so for ever
            self._ready.append(Processed(*self._waiting.popleft(), None, None))

    def shape(self, index: int, estimate: ShapeEstimate, surface: Surface | None) -> None:
        """The shape of the frame of that index; those before it will have none."""
        while self._waiting and self._waiting[0][0].index <= index:
            frame, observation = self._waiting.popleft()
            self._ready.append(Processed(frame, observation, estimate if frame.index == index else None, surface))

    def end(self, surface: Surface | None) -> None:
        """No more shapes for those that wait."""
        while self._waiting:
            self._ready.append(Processed(*self._waiting.popleft(), None, surface))

    def ready(self) -> Iterator[Processed]:
        """Those that are ready, each once."""
        while self._ready:
            yield self._ready.popleft()
