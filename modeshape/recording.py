"""Recordings as arrays."""

from collections.abc import Iterator
from functools import cached_property
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.playback.playback import Playback


def open_recording(path: str | PathLike[str]) -> "Recording":
    """Open a recording that `modeshape run` or `reconstruct` wrote: complete, of a run that was killed, or cut off.

    Raises:
        ValueError: it is missing, not a recording, or without a single frame.

    >>> import modeshape
    >>> recording = modeshape.open_recording("recordings/paper.rrd")
    >>> recording.shapes.shape, recording.visible.shape
    ((70, 120, 3), (70, 120))
    >>> recording.summary["rest_shape"]
    'plane'
    """
    return Recording(Playback.load(Path(path)))


class Recording:
    """A recording: F frames, P points, m triangles.

    Attributes:
        frames: (F,) numbers of the frames in their source.
        times_s: (F,) their times.
        visible: (F, P) which points are seen.
        points_px: (F, P, 2) where they are seen; NaN where they are not.
        configuration: the options of the run.
        summary: what came out of the run; None if it was cut off.
        events: (frame, time_s, level, text) of what happened.
    """

    def __init__(self, playback: Playback) -> None:
        self._playback = playback
        self.frames: NDArray[np.int64] = playback.frames
        self.times_s: NDArray[np.float64] = playback.times_s
        self.visible: NDArray[np.bool_] = playback.visible
        self.points_px: NDArray[np.float64] = playback.W.transpose(0, 2, 1)
        self.configuration = playback.configuration
        self.summary = playback.summary
        self.events = playback.events

    @cached_property
    def shapes(self) -> NDArray[np.float64]:
        """(F, P, 3) in camera axes, in pixels of the first frame, or millimetres with --size-mm; NaN in frames without one.

        Raises:
            ValueError: the run ended before its rest shape was found; so for what follows but the images.
        """
        return self._playback.shapes().transpose(0, 2, 1)

    @property
    def faces(self) -> NDArray[np.int64]:
        """(m, 3) points of each triangle."""
        return self._playback.mesh.faces

    @property
    def rest(self) -> NDArray[np.float64]:
        """(P, 3) the rest shape."""
        return self._playback.basis.rest.T

    @property
    def focal_px(self) -> float:
        """Focal length of the camera; infinite if it is orthographic."""
        return self._playback.camera.focal_px

    def images(self) -> Iterator[NDArray[np.uint8] | None]:
        """The picture (H, W, 3) BGR of each frame, decoded one at a time; None where there is none."""
        return (image for _, image in self._playback.images())
