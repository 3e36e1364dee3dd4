"""Writing a video: frames go in, a file appears when it is complete."""

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

import cv2
import numpy as np

from app.arrays import Array, Image, Indices
from app.files.writing import moved_when_complete
from app.terminal.errors import UsageError

CODECS = {".mp4": "mp4v", ".webm": "VP80"}
CHECKED_FRAMES = 30  # between two looks at the disk
FULL_BYTES = 2**20  # so little left on a disk explains a failure


@contextmanager
def writable_video(path: Path, size: tuple[int, int], fps: float) -> Iterator["VideoSink"]:
    """A video that appears under its name only when complete.

    .mp4 (MPEG-4 part 2) is written fast and plays in every player, but not in browsers; .webm (VP8) plays there too.

    Args:
        path: the file, .mp4 or .webm.
        size: (width, height) px of the frames; of odd ones the last row or column is not written.
        fps: frames per second.

    Raises:
        UsageError: another format, no frame, or the file cannot be written.
    """
    check_video_format(path)
    with moved_when_complete(path) as part:
        sink = VideoSink(path, part, size, fps)
        try:
            yield sink
        finally:
            sink.release()
        sink.check()


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
        self._path, self._part, self._size = path, part, size
        codec = CODECS[path.suffix.lower()]
        # Containers store a rate as a fraction: three digits are enough for it to be a short one.
        with quiet():
            self._writer = cv2.VideoWriter(str(part), cv2.VideoWriter.fourcc(*codec), round(fps, 3), size)
        if not self._writer.isOpened():
            raise UsageError(f"cannot write {path}: this OpenCV has no {codec} encoder, or the folder is not writable")
        self._frames = 0

    def write(self, image: Image) -> None:
        """The next frame, (H, W, 3) BGR.

        Raises:
            UsageError: the disk is full.
        """
        assert image.shape[1::-1] == self._size, "OpenCV would drop the frame without a word"
        self._writer.write(image)
        self._frames += 1
        if self._frames % CHECKED_FRAMES == 0 and self._full():
            raise self._failure("the disk is full")

    def release(self) -> None:
        """No more frames come."""
        self._writer.release()

    def check(self) -> None:
        """Check that every frame can be read again and room is left: OpenCV does not tell when a disk is full.

        Raises:
            UsageError: no frame was written, or not all of them.
        """
        if self._frames == 0:
            raise UsageError(f"cannot write {self._path}: there is no frame to write")
        if self._full():
            raise self._failure("the disk is full")
        with quiet():
            written = cv2.VideoCapture(str(self._part))
            frames = 0  # what a container announces says nothing: the head of a .webm is corrected in place
            while frames < self._frames and written.grab():
                frames += 1
            written.release()
        if frames < self._frames:
            raise self._failure("the disk took only a part of it")

    def _full(self) -> bool:
        return shutil.disk_usage(self._part.parent).free < FULL_BYTES

    def _failure(self, reason: str) -> UsageError:
        return UsageError(f"cannot write {self._path}: {reason}; free some space or choose another place with --out")


class PacedVideo:
    """Frames with times of their own in a video of constant rate: each is shown until the next one's time.

    A context manager that at its end shows the last frame, too.

    Args:
        sink: the video.
        fps: its rate.
    """

    def __init__(self, sink: VideoSink, fps: float) -> None:
        self._sink, self._fps = sink, fps
        self._shown: Image | None = None
        self._begun_s = 0.0
        self._frames = 0

    def write(self, image: Image, time_s: float) -> None:
        """The frame (H, W, 3) of a time; frames too close to be shown are left out."""
        if self._shown is None:
            self._begun_s = time_s
        self._fill(round((time_s - self._begun_s) * self._fps))
        self._shown = image

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if kind is None:
            self._fill(self._frames + 1)

    def _fill(self, frames: int) -> None:
        while self._shown is not None and self._frames < frames:
            self._sink.write(self._shown)
            self._frames += 1


def steady(times_s: Array) -> tuple[float, Indices]:
    """Frames per second of a video, and how many times each frame (F,) is shown so that it keeps its time there."""
    steps = np.diff(times_s)
    if not (steps > 0).any():
        return 25.0, np.ones(len(times_s), np.int64)
    fps = float(1 / np.median(steps[steps > 0]))
    ticks = np.round((times_s - times_s[0]) * fps).astype(np.int64)
    return fps, np.diff(ticks, append=ticks[-1] + 1).clip(0)


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing on stderr meanwhile: OpenCV warns of the codec's tag in .webm files that it then writes well."""
    sys.stderr.flush()
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


def check_video_format(path: Path) -> None:
    """Check that a video of that name can be written.

    Raises:
        UsageError: neither .mp4 nor .webm.
    """
    if path.suffix.lower() not in CODECS:
        raise UsageError(f"cannot write {path}: videos are written as {' or '.join(CODECS)}")
