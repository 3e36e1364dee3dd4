"""Files that OpenCV makes no pictures of, by the decoders of PyAV: AV1, and interlaced video."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import chain
from typing import TYPE_CHECKING, cast

import cv2
import numpy as np

from tracking import Image, TrackingError

if TYPE_CHECKING:
    from av import VideoFrame


class Decoder:
    """A file's pictures as players show them: upright, and without the combs of interlaced ones; as a cv2.VideoCapture.

    Args:
        source: the file.

    Raises:
        TrackingError: it is no video.
    """

    def __init__(self, source: str) -> None:
        import av  # few come here

        self._failed: tuple[type[Exception], ...] = (av.FFmpegError, StopIteration)
        try:
            self._file = av.open(source)
            self._stream = self._file.streams.video[0]
        except (av.FFmpegError, IndexError) as error:
            raise TrackingError(f"{source} cannot be decoded; it is not a video, or it is damaged or cut off") from error
        self._stream.thread_type = "AUTO"
        frames, first = self._progressive(self._whole()), None
        with suppress(av.FFmpegError):
            first = next(frames, None)
        self._rotation = first.rotation if first else 0
        self._frames = chain(filter(None, [first]), frames)
        self._began_s = float((self._stream.start_time or 0) * (self._stream.time_base or 0))
        self._frame: VideoFrame | None = None

    def grab(self) -> bool:
        """Go to the next picture; False at the end, or where it is damaged."""
        try:
            self._frame = next(self._frames)
        except self._failed:
            return False
        return True

    def retrieve(self) -> tuple[bool, Image]:
        """The picture gone to."""
        if self._frame is None:
            return False, np.empty((0, 0, 3), np.uint8)
        image = np.rot90(self._frame.to_ndarray(format="bgr24"), round(self._frame.rotation / 90))
        return True, cast(Image, np.ascontiguousarray(image))

    def get(self, propId: int, /) -> float:
        """Those properties that are asked of a file; 0 for what it does not say, and others."""
        stream = self._stream
        rate, aspect = float(stream.average_rate or 0), stream.sample_aspect_ratio
        seconds = float(stream.duration * stream.time_base) if stream.duration and stream.time_base else 0.0
        return {
            cv2.CAP_PROP_POS_MSEC: 1000 * ((self._frame.time or 0.0) - self._began_s) if self._frame else 0.0,
            cv2.CAP_PROP_FPS: rate,
            cv2.CAP_PROP_BITRATE: float((self._file.bit_rate or 0) // 1000),
            cv2.CAP_PROP_FRAME_WIDTH: float(stream.width),
            cv2.CAP_PROP_FRAME_HEIGHT: float(stream.height),
            cv2.CAP_PROP_ORIENTATION_META: float(self._rotation),
            cv2.CAP_PROP_FRAME_COUNT: float(stream.frames or round(rate * seconds)),
            cv2.CAP_PROP_SAR_NUM: float(aspect.numerator) if aspect else 0.0,
            cv2.CAP_PROP_SAR_DEN: float(aspect.denominator) if aspect else 0.0,
        }.get(propId, 0.0)

    def release(self) -> None:
        """Close the file."""
        self._file.close()

    def _whole(self) -> "Iterator[VideoFrame]":
        """The frames of packets that are not damaged; those of the file would end at the first that is."""
        from av import InvalidDataError

        for packet in self._file.demux(self._stream):
            with suppress(InvalidDataError):
                yield from packet.decode()

    def _progressive(self, frames: "Iterator[VideoFrame]") -> "Iterator[VideoFrame]":
        """The frames, those of interlaced video with the lines in between reckoned anew (BWDIF)."""
        from av.filter import Graph

        first = next(frames, None)
        if first is None or not first.interlaced_frame:
            yield from chain(filter(None, [first]), frames)
            return
        graph = Graph()
        graph.link_nodes(
            graph.add_buffer(template=self._stream), graph.add("bwdif", "send_frame"), graph.add("buffersink")
        ).configure()
        for frame in chain([first], frames, [None]):
            graph.push(frame)
            while True:
                try:
                    yield cast("VideoFrame", graph.pull())
                except (BlockingIOError, EOFError):  # it wants another one; that was the last
                    break


def interlaced(source: str) -> bool:
    """Whether the first frame of a file says so."""
    import av  # few come here

    try:
        with av.open(source) as file:
            return next(file.decode(video=0)).interlaced_frame
    except (av.FFmpegError, StopIteration, IndexError):
        return False
