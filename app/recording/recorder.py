"""Recordings written by a process of their own, so that Rerun's work and JPEG take nothing from the frame loop."""

import os
import pickle
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import IO, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from app.recording.environment import environment
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modes import ModalBasis
from reconstruction.camera import Camera
from reconstruction.settings import Metric
from reconstruction.window.model import ShapeEstimate
from tracking.klt import Observation
from tracking.video import Frame

Indices = NDArray[np.int64]

LENGTH = Struct("<Q")
MOST_UNANSWERED = 16  # calls, some four frames
NO_PICTURE = np.empty((0, 0, 3), np.uint8)


Call = tuple[str, tuple[Any, ...], dict[str, Any]]


class Recorder:
    """A `Recording` in a process of its own: the same verbs, which return before it is done.

    What goes wrong there is raised some calls later, or by `close`. The process completes the file when nothing more
    is told, also because the run was killed.

    Args:
        path: as for `Recording`; without one or a viewer, there is no process either.
        connect: the same.
        view: the same.
        image: the same.
        options: its other arguments.
    """

    def __init__(
        self,
        path: Path | None,
        *,
        connect: str | None = None,
        view: bool = False,
        image: Literal["jpeg", "video", "none"] = "jpeg",
        **options: object,
    ) -> None:
        self.path, self._pictures = path, image == "jpeg"
        self._unanswered = 0
        self._process: subprocess.Popen[bytes] | None = None
        if path or connect or view:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "app.recording.recorder"],  # -P: nothing from the user's folder
                env=environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,  # Ctrl-C ends the run, which then tells what is left to write
            )
        self._call("open", path, connect=connect, view=view, image=image, **options)

    def observe(self, frame: Frame, observation: Observation, *, phase: str) -> None:
        """A frame, its tracked points and the run's phase."""
        told = frame if self._pictures else replace(frame, image=NO_PICTURE)
        self._call("observe", told, observation, phase=phase)

    def rest(
        self,
        basis: ModalBasis,
        faces: Indices,
        edges: Indices,
        camera: Camera,
        *,
        texture_bgr: NDArray[np.uint8],
        texture_px: NDArray[np.float64],
    ) -> None:
        """The model."""
        self._call("rest", basis, faces, edges, camera, texture_bgr=texture_bgr, texture_px=texture_px)

    def estimate(self, index: int, time_s: float, estimate: ShapeEstimate) -> None:
        """One frame's shape and pose."""
        self._call("estimate", index, time_s, estimate)

    def timing(self, index: int, time_s: float, stage_ms: Mapping[str, float]) -> None:
        """Milliseconds that each stage took for one frame."""
        self._call("timing", index, time_s, dict(stage_ms))

    def event(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Something that happened, in words."""
        self._call("event", index, time_s, text, level)

    def modes(self, basis: ModalBasis, mesh: Mesh, metric: Metric) -> None:
        """The figure of the mode shapes."""
        self._call("modes", basis, mesh, metric)

    def summary(self, values: Mapping[str, object]) -> None:
        """What came out of the run."""
        self._call("summary", dict(values))

    def close(self, *, failed: bool = False) -> None:
        """Complete the file as `Recording.leave` does, and return when that is done; a second time, nothing.

        Raises:
            what has gone wrong there.
        """
        if self._process is None:
            return
        try:
            self._call("leave", failed=failed)
            while self._unanswered:
                self._answer(self._process)
        finally:
            process, self._process = self._process, None
            with suppress(OSError):
                pipe(process.stdin).close()
            process.wait()
            pipe(process.stdout).close()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.close(failed=isinstance(error, Exception))
        except UsageError:
            if error is None:  # what ended the run matters more
                raise

    def _call(self, verb: str, *arguments: object, **named: object) -> None:
        if self._process is None:
            return
        try:
            send(pipe(self._process.stdin), (verb, arguments, named))
        except OSError as error:
            raise self._gone() from error
        self._unanswered += 1
        while self._unanswered > MOST_UNANSWERED:
            self._answer(self._process)

    def _answer(self, process: "subprocess.Popen[bytes]") -> None:
        try:
            answer = receive(pipe(process.stdout))
        except (OSError, EOFError) as error:
            raise self._gone() from error
        self._unanswered -= 1
        if isinstance(answer, BaseException):
            raise answer

    def _gone(self) -> UsageError:
        self._unanswered = 0
        return UsageError("the process that writes the recording has ended: the memory or the disk may be full")


def pipe(stream: IO[bytes] | None) -> IO[bytes]:
    """One of the process's streams, which is there."""
    assert stream is not None
    return stream


def send(stream: IO[bytes], message: object) -> None:
    """Write an object; arrays in it are not copied."""
    buffers: list[pickle.PickleBuffer] = []
    head = pickle.dumps(message, protocol=5, buffer_callback=buffers.append)
    stream.write(LENGTH.pack(1 + len(buffers)))
    parts: list[bytes | memoryview] = [head, *(buffer.raw() for buffer in buffers)]
    for part in parts:
        stream.write(LENGTH.pack(len(part)))
        stream.write(part)
    stream.flush()


def receive(stream: IO[bytes]) -> object:
    """Read an object that `send` wrote.

    Raises:
        EOFError: there is none, or only a part of one.
    """

    def block(size: int) -> bytearray:
        part = bytearray(size)
        if stream.readinto(part) < size:  # type: ignore[attr-defined]
            raise EOFError
        return part

    (count,) = LENGTH.unpack(block(LENGTH.size))
    head, *buffers = [block(*LENGTH.unpack(block(LENGTH.size))) for _ in range(count)]
    return pickle.loads(head, buffers=buffers)


def main() -> None:
    """What the other process does."""
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    import cv2

    from app.recording.recording import Recording

    cv2.setNumThreads(1)
    recording: Recording | None = None
    failed = False
    try:
        while True:
            verb, arguments, named = cast(Call, receive(sys.stdin.buffer))
            answer: Exception | None = None
            try:
                if verb == "open":
                    recording = Recording(*arguments, **named)
                elif recording is not None and (verb == "leave" or not failed):  # else Rerun would keep it, and wait
                    getattr(recording, verb)(*arguments, **named)
            except Exception as error:  # raised in the run's process
                answer, failed = error, True
            with suppress(OSError):  # the run was killed: what it said until then is written
                send(answers, answer)
    except EOFError:
        if recording is not None and not failed:
            recording.close()  # nothing to do after "leave"
        os._exit(0)  # what Rerun could not write, it would wait for


if __name__ == "__main__":
    main()
