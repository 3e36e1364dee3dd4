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

from app.arrays import Image
from app.terminal.errors import UsageError

CODECS = {".mp4": "mp4v", ".webm": "VP80"}
CHECKED_FRAMES = 30  # between two looks at the disk
FULL_BYTES = 2**20  # so little left on a disk explains a failure


class VideoSink:
    """A video being written; a context manager.

    .mp4 (MPEG-4 part 2) is written fast and plays in every player, but not in browsers; .webm (VP8) plays there too.

    Args:
        path: the file, .mp4 or .webm.
        size: (width, height) px of the frames; of odd ones the last row or column is not written.
        fps: frames per second.

    Raises:
        UsageError: another format, or the file cannot be written.
    """

    def __init__(self, path: Path, size: tuple[int, int], fps: float) -> None:
        check_video_format(path)
        self.path = path
        self._part = path.with_name(f"{path.stem}.part{path.suffix}")
        self._size = size
        codec = CODECS[path.suffix.lower()]
        # Containers store a rate as a fraction: three digits are enough for it to be a short one.
        with quiet():
            self._writer = cv2.VideoWriter(str(self._part), cv2.VideoWriter.fourcc(*codec), round(fps, 3), size)
        if not self._writer.isOpened():
            self._part.unlink(missing_ok=True)
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._writer.release()
        try:
            if kind is None:
                self._check()
                self._part.replace(self.path)
        finally:
            self._part.unlink(missing_ok=True)

    def _check(self) -> None:
        """OpenCV does not say when a disk is full: every frame must be there again, and room beside them."""
        if self._frames == 0:
            raise UsageError(f"cannot write {self.path}: there is no frame to write")
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
        return UsageError(f"cannot write {self.path}: {reason}; free some space or choose another place with --out")


class PacedVideo:
    """Frames with times of their own in a video of constant rate: each is shown until the next one's time.

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

    def end(self) -> None:
        """Show the last frame, too."""
        self._fill(self._frames + 1)

    def _fill(self, frames: int) -> None:
        while self._shown is not None and self._frames < frames:
            self._sink.write(self._shown)
            self._frames += 1


@contextmanager
def quiet() -> Iterator[None]:
    """Nothing on stderr meanwhile: OpenCV finds fault with the codec's tag in .webm files and then writes them well."""
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
    """See to it that a video of that name can be written.

    Raises:
        UsageError: neither .mp4 nor .webm.
    """
    if path.suffix.lower() not in CODECS:
        raise UsageError(f"cannot write {path}: videos are written as {' or '.join(CODECS)}")
