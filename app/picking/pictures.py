"""Pictures of a source for the page: any frame of a file, the newest of a camera."""

from collections.abc import Iterator
from typing import Self

import cv2

from app.terminal.errors import UsageError
from tracking import TrackingError
from tracking.video import Frame, Video


class Pictures:
    """Frames of a source as JPEG; a context manager.

    Args:
        source: video file, image pattern, camera index or URL.
        first: the first frame wanted, of a file.

    Attributes:
        live: whether it is a camera or a stream.
        frame_count: number of frames, if it is known.

    Raises:
        TrackingError: it cannot be read.
    """

    def __init__(self, source: str, first: int = 0) -> None:
        self._source = source
        try:
            self._video = Video(source, drop_late=True)
        except TrackingError as error:
            if error.about != "drop_late":
                raise
            self._video = Video(source, first)
        self.live = self._video.live
        count = self._video.frame_count
        self.frame_count = None if count is None else count + first
        self._at, self._frames = first, iter(self._video)

    def jpeg(self, number: int) -> bytes:
        """A frame; of a live source the newest, whatever its number.

        Raises:
            UsageError: there is no such frame.
        """
        if not self.live and number != self._at:
            video = Video(self._source, number)
            self._video.close()
            self._video = video
            self._at, self._frames = number, iter(self._video)
        frame = self._next(self._frames, number)
        self._at += 1
        return cv2.imencode(".jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].tobytes()

    def _next(self, frames: Iterator[Frame], number: int) -> Frame:
        frame = next(frames, None)
        if frame is None:
            raise UsageError(f"{self._source} has no frame {number}")
        return frame

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._video.close()
