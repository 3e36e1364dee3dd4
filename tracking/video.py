"""Frames with true time stamps from a file, an image pattern, a camera or a URL."""

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, Full, Queue
from time import monotonic
from types import TracebackType
from typing import Self, cast

import cv2
import numpy as np

from tracking import Image, TrackingError
from tracking.sources.capture import Log, Reconnecting, announced_frames, as_bgr, is_camera, open_capture, probe

DEFAULT_FPS = 30.0  # of sources that do not tell
DECODE_AHEAD = 4  # frames waiting in the queue: enough to hide decoding, little memory
LATE_S = 0.05  # frames of a live source that have waited for longer may be dropped: a short stall costs none
BROKEN_FRAMES = 300  # so many unreadable frames in a row, some ten seconds, end the source


@dataclass(frozen=True)
class Frame:
    """One picture of the source.

    Attributes:
        index: 0-based number of the frame in its source.
        time_s: its time stamp in seconds.
        image: (H, W, 3) uint8 BGR.
    """

    index: int
    time_s: float
    image: Image


class Video:
    """An iterator of `Frame` over a video; a context manager that stops its decoding thread.

    The first frame is decoded at once, so that everything that can be wrong with a source is said here.

    Args:
        source: a file, a printf pattern of images ("img%04d.png"), the index of a camera ("0") or a URL.
        first: index of the first frame delivered.
        stop: index of the first frame not delivered any more; None reads to the end.
        duration_s: so long after the first frame the video ends; None for no limit.
        drop_late: of a live source, drop frames that nobody had time for within 50 ms, unless they are the newest.
        log: told in words what is unusual: pixels, missing images, and, in another thread, that a stream breaks or resumes.

    Attributes:
        live: whether frames come when they happen: a camera, or a stream without end. Their time stamps are
            those of their arrival, from 0.
        size: (width, height) in px.
        first_index: of its first frame.
        frame_count: announced number of frames that will be delivered, a hint only: containers lie, and
            None where the source does not say (live sources).
        fps: announced rate, a hint only.

    Raises:
        TrackingError: the source is missing, cannot be decoded, or has no frame in the asked range.
    """

    def __init__(
        self,
        source: str,
        first: int = 0,
        stop: int | None = None,
        *,
        duration_s: float | None = None,
        drop_late: bool = False,
        log: Log = lambda _: None,
    ) -> None:
        if first < 0 or (stop is not None and stop <= first):
            asked = f"{first}:{'' if stop is None else stop}"
            raise TrackingError(f"no frame in the range {asked}; ask for A:B with 0 <= A < B")
        self.source = source
        self._stop, self._duration_s, self._log = stop, duration_s, log
        self._closing, self._delivered = threading.Event(), 0
        probed = probe(source) if Path(source).is_file() else None
        self._capture = open_capture(source, self._closing, log, decodes=probed is None or probed.decodes)
        self.live = is_camera(source) or isinstance(self._capture, Reconnecting)
        if drop_late and not self.live:
            self._capture.release()
            raise TrackingError(f"{source} is no camera or stream: frames of a file are never late", "drop_late")
        self._drop_late = drop_late
        self._began = monotonic()
        self._index, self._time_s = 0, -np.inf  # of the next frame grabbed, of the last delivered
        self._timed = probed is not None and probed.times_rise
        fps = self._capture.get(cv2.CAP_PROP_FPS)
        self.fps = fps if 0.5 < fps < 1000.0 else DEFAULT_FPS
        self._announced = announced_frames(self._capture)
        try:
            self._skip_to(first)
            frame = self._read()
            if frame is None:
                raise self._nothing_left(first)
        except BaseException:
            self._capture.release()
            raise
        self._first = frame
        self.first_index = frame.index
        self.size = (frame.image.shape[1], frame.image.shape[0])
        self.frame_count: int | None = None
        if self._announced is not None:
            end = self._announced if stop is None else min(stop, self._announced)
            self.frame_count = max(end - frame.index, 1)
            if duration_s is not None:
                self.frame_count = min(self.frame_count, int(duration_s * self.fps) + 1)
        self._queue: Queue[Frame | BaseException | None] = Queue(0 if drop_late else DECODE_AHEAD)
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def __iter__(self) -> Iterator[Frame]:
        if self._thread is None:
            self._thread = threading.Thread(target=self._decode, name="decode", daemon=True)
            self._thread.start()
        while not self._closing.is_set():
            try:
                item = self._queue.get(timeout=0.1)
            except Empty:
                if self.live and self._duration_s is not None and monotonic() - self._began > self._duration_s:
                    return  # a broken stream brings no frame that would end it
                continue
            if item is None:
                self._put(None)  # a second iteration ends at once, too
                return
            if isinstance(item, BaseException):
                raise item
            yield item

    def arrived_s(self, frame: Frame) -> float:
        """When a frame came from a live source, as `time.monotonic` tells it; of others now."""
        return self._began + frame.time_s if self.live else monotonic()

    def close(self) -> None:
        """Stop decoding and release the source; iterating ends. May be called again."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        self._capture.release()

    def _decode(self) -> None:
        """Fill the queue until the end, an error, or `close`; None marks the end."""
        frame: Frame | None = self._first
        try:
            while frame is not None and self._put(frame):
                frame = self._read()
            self._tell_missing()
            self._put(None)
        except BaseException as error:  # handed to the thread that iterates
            self._put(error)

    def _tell_missing(self) -> None:
        """Say how many of the frames there should have been could not be read."""
        if self._announced is None or self._duration_s is not None or self._closing.is_set():
            return
        due = min(self._announced, self._stop or self._announced) - self._first.index
        if self._delivered < due - 1:  # containers are off by one
            self._log(f"{due - self._delivered} of {due} frames cannot be read, and are left out: {self.source} is damaged")

    def _put(self, item: Frame | BaseException | None) -> bool:
        if self._drop_late and isinstance(item, Frame):
            with self._queue.mutex:
                leave_out_late(self._queue.queue, item.time_s)
        while not self._closing.is_set():
            with suppress(Full):
                self._queue.put(item, timeout=0.1)
                return True
        return False

    def _skip_to(self, first: int) -> None:
        # Not by seeking: containers miss the frame by up to a group of pictures.
        while self._index < first:
            if not self._grab():
                raise self._nothing_left(first)
            self._index += 1

    def _grab(self) -> bool:
        """Go to the next frame that is whole, past broken ones; False at the end of the source."""
        start = self._index
        for _ in range(BROKEN_FRAMES):
            if self._capture.grab():
                return True
            if self._announced is None or self._index + 1 >= self._announced:
                break
            self._index += 1
        self._index = start
        return False

    def _read(self) -> Frame | None:
        """The next frame that decodes, or None at the end of the source or of the asked range."""
        for _ in range(BROKEN_FRAMES):
            if (self._stop is not None and self._index >= self._stop) or not self._grab():
                return None
            ok, image = self._capture.retrieve()
            if ok and image is not None and image.size:
                frame = self._frame(as_bgr(image))
                return frame if self._in_time(frame) else None
            self._index += 1
        return None

    def _in_time(self, frame: Frame) -> bool:
        return (
            self._duration_s is None or not hasattr(self, "_first") or frame.time_s - self._first.time_s < self._duration_s
        )

    def _frame(self, image: Image) -> Frame:
        if hasattr(self, "size") and (image.shape[1], image.shape[0]) != self.size:
            image = cast(Image, cv2.resize(image, self.size))  # a stream may change its resolution
        time_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        if self.live:
            time_s = max(monotonic() - self._began, self._time_s + 1e-3)
        elif not self._timed:
            time_s = self._index / self.fps
        if not np.isfinite(time_s) or time_s <= self._time_s:
            time_s = self._time_s + 1.0 / self.fps if self._index > 0 else 0.0
        self._time_s = time_s
        self._delivered += 1
        frame = Frame(self._index, time_s, image)
        self._index += 1
        return frame

    def _nothing_left(self, first: int) -> TrackingError:
        if 0 < first < (self._announced or 0) - 1:  # containers are off by one
            return TrackingError(f"frame {first} of {self.source} cannot be read; ask for another")
        if self._index > 0:
            return TrackingError(f"{self.source} ends at frame {self._index}; ask for frames before it")
        code = int(self._capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little", signed=True)
        codec = code.decode("ascii", "replace").strip("\0 ")
        if "://" in self.source:
            return TrackingError(
                f"{self.source} gives no frame: it is no video, or its server does not serve parts of files; download it"
            )
        named = f" (codec {codec})" if codec.isprintable() and codec else ""
        return TrackingError(f"{self.source} has no frame that can be decoded{named}; convert it to H.264 with ffmpeg")


def leave_out_late(waiting: deque[Frame | BaseException | None], now_s: float) -> None:
    """Take those frames out of a queue that came too long ago for anyone to want them."""
    while waiting and isinstance(waiting[0], Frame) and now_s - waiting[0].time_s > LATE_S:
        waiting.popleft()
