"""The stage that writes recordings: in a process of its own, Rerun's work and JPEG take nothing from the frame loop."""

import os
import pickle
import signal
import subprocess
from dataclasses import replace
from multiprocessing.connection import Connection
from queue import Queue
from threading import Thread
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Self, cast

import numpy as np

from app.processes.child import connection_to_parent, inherited_file
from app.processes.ring import Ring
from app.terminal.errors import UsageError
from app.terminal.interrupts import undisturbed
from tracking.video import Frame

if TYPE_CHECKING:
    from app.recording.recording import Recording

MOST_WAITING = 64  # calls, some ten frames: then the run waits for the disk
HANGS_S = 60  # a call that takes longer will not end: Rerun waits for disks that are full

NO_PICTURE = np.empty((0, 0, 3), np.uint8)

Call = tuple[str, tuple[Any, ...], dict[str, Any], int | None]  # with the number of the picture of a frame


class Recorder(Protocol):
    """Calls the methods of a `Recording`, one after another."""

    def tell(self, method: str, *arguments: object, **named: object) -> None:
        """Call a method, soon, with arguments that do not change until then.

        "open" stands for the constructor: another file from here on, the one before is completed.

        Raises:
            what a call raised.
        """

    def observe(self, frame: Frame, number: int, *arguments: object, **named: object) -> None:
        """Call `Recording.observe` for a frame whose picture may be elsewhere, and has this number there."""


class Recordings:
    """One recording after another: what a call names is done at once.

    Once something went wrong nothing more is written: Rerun would keep it, and wait.
    """

    def __init__(self) -> None:
        self._recording: Recording | None = None
        self._failed = False

    def call(self, method: str, *arguments: Any, **named: Any) -> None:
        """Call a method of the recording; "open" begins another.

        Raises:
            whatever goes wrong.
        """
        from app.recording.recording import Recording  # Rerun takes its time to load

        try:
            if method == "open":
                if not self._failed:
                    self.close()
                    self._recording = Recording(*arguments, **named)
            elif self._recording is not None and (method == "leave" or not self._failed):
                getattr(self._recording, method)(*arguments, **named)
        except Exception:
            self._failed = True
            raise

    def close(self) -> None:
        """Complete the last one, if all went well."""
        if self._recording is not None and not self._failed:
            self._recording.close()


class RecordingHere:
    """Recordings written in this process; a context manager that completes the last.

    Args:
        needed: whether anything is written.
    """

    def __init__(self, *, needed: bool = True) -> None:
        self._recordings = Recordings() if needed else None

    def tell(self, method: str, *arguments: object, **named: object) -> None:
        """Call it now."""
        if self._recordings is not None:
            self._recordings.call(method, *arguments, **named)

    def observe(self, frame: Frame, number: int, *arguments: object, **named: object) -> None:  # noqa: ARG002
        """The frame has its picture."""
        self.tell("observe", frame, *arguments, **named)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        recordings, self._recordings = self._recordings, None
        if recordings is None:
            return
        try:
            recordings.call("leave", failed=isinstance(error, Exception))
        except Exception:
            if error is None:  # what ended the run matters more
                raise


class RecordingProcess:
    """Recordings written in another process; a context manager that completes the last.

    What goes wrong there is raised by a later call here, or at the end. The process completes the file when nothing more
    comes, also because the run was killed.

    Args:
        begun: the process and the connection to it; None writes nothing.
        pictures: where the pictures of frames are; each is released when it is written.
    """

    def __init__(self, begun: "tuple[subprocess.Popen[bytes], Connection] | None", pictures: Ring) -> None:
        self._error: BaseException | None = None
        self._waiting: Queue[Call | None] = Queue(MOST_WAITING)
        self._process: subprocess.Popen[bytes] | None = None
        self._pictures = pictures
        if begun is None:
            return
        self._process, self._connection = begun
        self._sender = Thread(target=self._send, name="record", daemon=True)
        self._sender.start()
        Thread(target=self._outlive, args=(self._process,), daemon=True).start()

    def tell(self, method: str, *arguments: object, **named: object) -> None:
        """Call a method of the recording, later."""
        self._raise()
        if self._process is not None:
            self._waiting.put((method, arguments, named, None))

    def observe(self, frame: Frame, number: int, *arguments: object, **named: object) -> None:
        """The picture is left where it is."""
        self._raise()
        if self._process is not None:
            self._waiting.put(("observe", (replace(frame, image=NO_PICTURE), *arguments), named, number))

    def close(self, *, failed: bool = False) -> None:
        """Complete the file as `Recording.leave` does, and return when that is done; a second time, nothing.

        Raises:
            what has gone wrong there.
        """
        process, self._process = self._process, None
        if process is not None:
            self._waiting.put(("leave", (), {"failed": failed}, None))
            self._waiting.put(None)
            self._sender.join()
            process.wait()
            self._connection.close()
        self._raise()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            with undisturbed():  # else another Ctrl-C would end the process that completes the file
                self.close(failed=isinstance(error, Exception))
        except Exception:
            if error is None:  # what ended the run matters more
                raise

    def _send(self) -> None:
        """Send what waits; the first thing that goes wrong is kept for the run's own thread."""
        calls = iter(self._waiting.get, None)
        try:
            self._connection.send(self._pictures.size)
            for call in calls:
                self._connection.send_bytes(pickle.dumps(call, protocol=5))
                while self._connection.poll():
                    if not self._receive():  # it was the last call, and is done already
                        return
            while self._receive():
                pass
        except Exception as error:
            gone = "the process that writes the recording has ended: the memory or the disk may be full"
            self._error = self._error or (UsageError(gone) if isinstance(error, OSError | EOFError) else error)
            self._connection.close()  # the process completes the file
            self._pictures.release_all()
            for _ in calls:  # the run does not wait for what nobody reads
                pass

    def _outlive(self, process: "subprocess.Popen[bytes]") -> None:
        """When the process has ended, however that was, nobody is to wait for it to release pictures."""
        process.wait()
        self._pictures.release_all()

    def _receive(self) -> bool:
        """Whether more is to come."""
        error = self._connection.recv()
        self._error = self._error or error
        return error is not None

    def _raise(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error


def main() -> None:
    """What the other process does: exceptions are sent back, and None once everything is written."""
    connection = connection_to_parent()
    import cv2

    import app.recording.recording  # noqa: F401 (Rerun takes its time to load: while the surface is looked for)

    cv2.setNumThreads(1)
    recordings = Recordings()
    method = ""
    try:
        pictures = Ring(inherited_file(2), connection.recv())
        while method != "leave":
            signal.alarm(0)
            data = connection.recv_bytes()
            method, arguments, named, number = cast(Call, pickle.loads(data))
            # Ends the process. To complete a file, or to convert a video that is stored in it, may take longer.
            signal.alarm(0 if method in ("open", "leave") else HANGS_S)
            if number is not None:
                arguments = (replace(arguments[0], image=pictures.picture(number)), *arguments[1:])
            try:
                recordings.call(method, *arguments, **named)
            except Exception as error:  # raised in the run's process
                connection.send(error)
            if number is not None:
                pictures.release(number)
        connection.send(None)
    except (EOFError, OSError):  # the run was killed: what it told until then is written
        recordings.close()
    os._exit(0)  # what Rerun could not write, it would wait for


if __name__ == "__main__":
    main()
