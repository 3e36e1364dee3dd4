"""Recordings written by a process of their own, so that Rerun's work and JPEG take nothing from the frame loop."""

import os
import pickle
import subprocess
from queue import Queue
from threading import Thread
from types import TracebackType
from typing import Any, Self, cast

from app.child import child, connection_to_parent
from app.terminal.errors import UsageError

MOST_WAITING = 64  # calls, some ten frames: then the run waits for the disk

Call = tuple[str, tuple[Any, ...], dict[str, Any]]


class RecordingProcess:
    """Calls the methods of a `Recording` in another process; a context manager that completes its file.

    What goes wrong there is raised by a later call here, or at the end. The process completes the file when nothing more
    comes, also because the run was killed.

    Args:
        needed: whether anything is written; without it there is no process, and nothing happens.
    """

    def __init__(self, *, needed: bool = True) -> None:
        self._error: BaseException | None = None
        self._waiting: Queue[Call | None] = Queue(MOST_WAITING)
        self._process: subprocess.Popen[bytes] | None = None
        if not needed:
            return
        self._process, self._connection = child("app.recording.process")
        self._sender = Thread(target=self._send, name="record", daemon=True)
        self._sender.start()

    def tell(self, method: str, *arguments: object, **named: object) -> None:
        """Call a method of the recording, later, with arguments that do not change until then.

        "open" stands for the recording's constructor: another file from here on, the one before is completed.

        Raises:
            what an earlier call raised there.
        """
        self._raise()
        if self._process is not None:
            self._waiting.put((method, arguments, named))

    def close(self, *, failed: bool = False) -> None:
        """Complete the file as `Recording.leave` does, and return when that is done; a second time, nothing.

        Raises:
            what has gone wrong there.
        """
        process, self._process = self._process, None
        if process is not None:
            self._waiting.put(("leave", (), {"failed": failed}))
            self._waiting.put(None)
            self._sender.join()
            process.wait()
            self._connection.close()
        self._raise()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.close(failed=isinstance(error, Exception))
        except Exception:
            if error is None:  # what ended the run matters more
                raise

    def _send(self) -> None:
        """Send what waits; the first thing that goes wrong is kept for the run's own thread."""
        calls = iter(self._waiting.get, None)
        try:
            for call in calls:
                self._connection.send_bytes(pickle.dumps(call, protocol=5))
                while self._connection.poll():
                    self._receive()
            while self._receive():
                pass
        except Exception as error:
            gone = "the process that writes the recording has ended: the memory or the disk may be full"
            self._fail(UsageError(gone) if isinstance(error, OSError | EOFError) else error)
            self._connection.close()  # the process completes the file
            for _ in calls:  # the run does not wait for what nobody reads
                pass

    def _receive(self) -> bool:
        """Whether more is to come."""
        error = self._connection.recv()
        if error is not None:
            self._fail(error)
        return error is not None

    def _fail(self, error: BaseException) -> None:
        self._error = self._error or error

    def _raise(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error


def main() -> None:
    """What the other process does: exceptions are sent back, and None once everything is written."""
    import cv2

    from app.recording.recording import Recording

    cv2.setNumThreads(1)
    connection = connection_to_parent()
    recording: Recording | None = None
    failed = False
    method = ""
    try:
        while method != "leave":
            method, arguments, named = cast(Call, pickle.loads(connection.recv_bytes()))
            try:
                if method == "open" and not failed:
                    if recording is not None:
                        recording.close()
                    recording = Recording(*arguments, **named)
                elif recording is not None and (method == "leave" or not failed):  # else Rerun would keep it, and wait
                    getattr(recording, method)(*arguments, **named)
            except Exception as error:  # raised in the run's process
                failed = True
                connection.send(error)
        connection.send(None)
    except (EOFError, OSError):  # the run was killed: what it told until then is written
        if recording is not None and not failed:
            recording.close()
    os._exit(0)  # what Rerun could not write, it would wait for


if __name__ == "__main__":
    main()
