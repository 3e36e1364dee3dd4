"""Writing a video: frames with their times go in, a file appears when it is complete."""

import os
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np

from app.arrays import Array, Image
from app.files.writing import moved_when_complete
from app.terminal.errors import UsageError

CODECS = {".mp4": "libx264", ".webm": "libvpx-vp9"}  # H.264 plays everywhere, in browsers, too
OPTIONS = {
    # The stream's header tells the frame rate, not the ticks of the times: FFmpeg's program takes them for 90,000 frames a
    # second, and viewers that decode with it show none.
    "libx264": {"preset": "superfast", "crf": "20", "x264-params": "force-cfr=1"},
    "libvpx-vp9": {"deadline": "realtime", "cpu-used": "8", "crf": "30", "b": "0", "row-mt": "1"},
}
TICKS = 90_000  # a second: of the usual rates, each frame is a whole number of them
USUAL_FPS = 25.0  # of a single frame


@contextmanager
def writable_video(path: Path, size: tuple[int, int], fps: float) -> Iterator["VideoSink"]:
    """A video that appears under its name only when complete.

    Args:
        path: the file, .mp4 (H.264) or .webm (VP9).
        size: (width, height) px of the frames; of odd ones the last row or column is not written.
        fps: frames per second, usually.

    Raises:
        UsageError: another format, no frame, or the file cannot be written.
    """
    check_video_format(path)
    with moved_when_complete(path) as part:
        sink = VideoSink(path, part, size, fps)
        try:
            yield sink
        except BaseException:
            sink.close(complete=False)
            raise
        sink.close()


class VideoSink:
    """Where the frames of a video go, as `writable_video` opens it.

    Args:
        path: what the file is to be called, for errors.
        part: the file.
        size, fps: of `writable_video`.

    Raises:
        UsageError: it cannot be written.
    """

    def __init__(self, path: Path, part: Path, size: tuple[int, int], fps: float) -> None:
        self._path, self._size, self._step = path, size, max(1, round(TICKS / fps))
        codec = CODECS[path.suffix.lower()]
        try:
            self._file = av.open(str(part), "w", options={"movflags": "faststart"} if path.suffix.lower() == ".mp4" else {})
            rate = Fraction(fps).limit_denominator(1001)
            self._stream = cast(av.VideoStream, self._file.add_stream(codec, rate, options=OPTIONS.get(codec)))
        except av.FFmpegError as error:
            raise self._failure(error) from error
        except ValueError:  # its error for this has no public name
            raise UsageError(f"cannot write {path}: this PyAV has no {codec} encoder") from None
        self._stream.width, self._stream.height = (side // 2 * 2 for side in size)
        self._stream.pix_fmt = "yuv420p"
        self._stream.time_base = self._stream.codec_context.time_base = Fraction(1, TICKS)
        self._stream.codec_context.thread_count = min(8, os.cpu_count() or 1)
        self._begun_s = 0.0
        self._tick = -1  # of the last frame
        self._encoder = ThreadPoolExecutor(1, "encode")  # meanwhile the next frame is drawn
        self._encoding: Future[None] | None = None

    def write(self, image: Image, time_s: float) -> None:
        """The next frame, (H, W, 3) BGR, which is shown from this time on; the first at the video's begin.

        Raises:
            UsageError: the disk is full, perhaps since the frame before.
        """
        assert image.shape[1::-1] == self._size, "a frame of another size"
        if self._tick < 0:
            self._begun_s, tick = time_s, 0
        else:
            tick = round((time_s - self._begun_s) * TICKS)
            tick = tick if tick > self._tick else self._tick + self._step
        height, width = self._stream.height, self._stream.width
        frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image[:height, :width]), format="bgr24")
        frame.pts, frame.time_base, self._tick = tick, Fraction(1, TICKS), tick
        self._wait()
        self._encoding = self._encoder.submit(self._put, frame)

    def close(self, *, complete: bool = True) -> None:
        """No more frames come.

        Raises:
            UsageError: there was none, or they cannot be written.
        """
        try:
            with self._encoder:
                if complete:
                    self._wait()
            if complete and self._tick >= 0:
                self._put(None)
            self._file.close()
        except (av.FFmpegError, OSError) as error:
            if complete:
                raise self._failure(error) from error
        if complete and self._tick < 0:
            raise UsageError(f"cannot write {self._path}: there is no frame to write")

    def _wait(self) -> None:
        """Until the frame before is encoded; raises what went wrong with it."""
        if self._encoding is not None:
            self._encoding.result()

    def _put(self, frame: av.VideoFrame | None) -> None:
        """Encode a frame, or what is left."""
        try:
            for packet in self._stream.encode(frame):
                self._file.mux(packet)
        except (av.FFmpegError, OSError) as error:
            raise self._failure(error) from error

    def _failure(self, error: Exception) -> UsageError:
        reason = getattr(error, "strerror", None) or str(error)
        return UsageError(f"cannot write {self._path}: {reason}; free some space or choose another place with --out")


def usual_fps(times_s: Array) -> float:
    """Frames per second of a video with frames (F,) at these times."""
    steps = np.diff(times_s)
    rising = steps[steps > 0]
    return float(1 / np.median(rising)) if len(rising) else USUAL_FPS


def check_video_format(path: Path) -> None:
    """Check that a video of that name can be written.

    Raises:
        UsageError: neither .mp4 nor .webm.
    """
    if path.suffix.lower() not in CODECS:
        raise UsageError(f"cannot write {path}: videos are written as {' or '.join(CODECS)}")
