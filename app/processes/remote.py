"""Functions in processes of their own, over messages and answers."""

import os
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from typing import Any

from app.processes.child import child
from app.terminal.errors import UsageError


class Remote:
    """A function in a process of its own: messages go there, answers come back in order; it runs until it is closed.

    Args:
        module: what the process runs: it has to `serve`.
        does: what is missing without it, for errors.
        files, nice: as for `child`.
    """

    def __init__(self, module: str, does: str, *files: int, nice: int = 0) -> None:
        self._does = does
        self._process, self._connection = child(module, *files, nice=nice)

    def send(self, message: object) -> None:
        """A message for it. Raises a UsageError if the process has ended."""
        self.send_packed(packed(message))

    def send_packed(self, message: memoryview) -> None:
        """The same of one that is `packed`."""
        try:
            self._connection.send_bytes(message)
        except OSError as error:
            raise self._ended() from error

    def receive(self) -> Any:
        """The answer to the oldest message that has none.

        Raises:
            what the function raised there.
            UsageError: the process has ended.
        """
        try:
            failed, answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._ended() from error
        if failed:
            raise answer
        return answer

    def end(self) -> None:
        """End the process, whatever it does."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """End the process, and the connection to it."""
        self.end()
        self._connection.close()

    def _ended(self) -> UsageError:
        return UsageError(f"the process that {self._does} has ended: the memory may be full")


def packed(message: object) -> memoryview:
    """A message as it is now, so that it may be sent by another thread, whatever is done to its parts meanwhile."""
    return ForkingPickler.dumps(message)


def serve(connection: Connection, answer: Callable[[Any], Any]) -> None:
    """Answer messages until nobody listens any more; exceptions are answers, too, and are raised by `Remote.receive`."""
    try:
        while True:
            message = connection.recv()
            try:
                result = False, answer(message)
            except Exception as error:
                error.add_note("".join(traceback.format_exception(error)))  # which does not travel by itself
                result = True, error
            connection.send(result)
    except (EOFError, OSError):
        os._exit(0)
