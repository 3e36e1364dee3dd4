"""Painting the frames of a video, one after another, into a new video."""

from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Self

import numpy as np

from app.arrays import Array
from app.files.video_out import VideoSink, writable_video
from app.painting.compositing import Compositor
from app.painting.picture import Texture
from app.painting.placement import Placement
from reconstruction.basis.model import Model
from reconstruction.estimate import ShapeEstimate
from tracking.observation import Observation
from tracking.video import Frame


class Painter:
    """Paints frames as they come and writes them; a context manager that completes the video.

    Args:
        out: the new video.
        texture: the picture or video put on the surface.
        placement: where it lies.

    Attributes:
        placement: may be changed until the first frame.
        painted: number of frames painted.
    """

    def __init__(self, out: Path, texture: Texture, placement: Placement) -> None:
        self._out, self._texture, self.placement = out, texture, placement
        self._files = ExitStack()
        self._video: VideoSink | None = None
        self._compositor: Compositor | None = None
        self._first: tuple[Array, Compositor] | None = None  # the vertices of the first object, and what paints on it
        self._begun_s = 0.0
        self._elapsed_s = 0.0
        self.painted = 0

    @property
    def milliseconds(self) -> float | None:
        """Mean time of painting a frame."""
        return self._elapsed_s * 1e3 / self.painted if self.painted else None

    @property
    def begun(self) -> bool:
        """Whether there is a first object: the placement is of it."""
        return self._first is not None

    def begin(self, first: Frame, points_px: Array, model: Model, fps: float) -> None:
        """The first frame, the vertices (p, 2) px in it, the model, and the rate of the video.

        A second object is not painted: the picture was made for the first, and is painted on it again when it comes back.

        Raises:
            UsageError: the picture does not lie on the surface, or the video cannot be written.
        """
        if self._first is not None:
            vertices, compositor = self._first
            self._compositor = compositor if np.array_equal(points_px, vertices) else None
            return
        perspective = model.camera.perspective
        self._compositor = Compositor(first.image, points_px, model.mesh, perspective=perspective, placement=self.placement)
        self._first = points_px, self._compositor
        height, width = first.image.shape[:2]
        self._video = self._files.enter_context(writable_video(self._out, (width, height), fps))
        self._begun_s = first.time_s

    def frame(self, frame: Frame, observation: Observation, estimate: ShapeEstimate | None) -> None:
        """Paint and write a frame; one without a shape stays as it is.

        Raises:
            UsageError: the disk is full.
        """
        if self._video is None:
            return
        image = frame.image
        if estimate is not None and self._compositor is not None:
            picture = self._texture.at(frame.time_s - self._begun_s)
            started = perf_counter()
            image = self._compositor.paint(image, picture, estimate.projection_px, estimate.shape[2], observation.points_px)
            self._elapsed_s += perf_counter() - started
            self.painted += 1
        self._video.write(image, frame.time_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._files.__exit__(kind, error, trace)
