"""Processes of our own, each with a connection to the one that began it."""

import os
import subprocess
import sys
import traceback
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self

from app.environment import environment
from app.terminal.errors import UsageError


def child(module: str, *files: int) -> tuple["subprocess.Popen[bytes]", Connection]:
    """A process that runs a module of ours, and the connection to it; `connection_to_parent` is its other end.

    Not one of multiprocessing's: those run the user's own script again.

    Args:
        module: its name.
        files: open files that the process gets, too, by their numbers, which are its further arguments.
    """
    ours, theirs = Pipe()
    with theirs:
        return started(module, theirs.fileno(), *files), ours


def started(module: str, *files: int) -> "subprocess.Popen[bytes]":
    """The process, with open files, by their numbers, which are its arguments."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, *map(str, files)],  # -P: not the user's modules
        env=environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL,
        stdout=2,  # stderr: stdout is for the summary
        pass_fds=files,
        start_new_session=True,  # Ctrl-C ends the run, which then tells what is left to do
    )


def connection_to_parent() -> Connection:
    """The connection of a process that `child` began."""
    return Connection(inherited_file(1))


def inherited_file(place: int) -> int:
    """The number of an open file that `started` gave, by its place among the arguments; our own children lack it."""
    number = int(sys.argv[place])
    os.set_inheritable(number, False)
    return number


class Remote:
    """A function in a process of its own: messages go there, answers come back in order; a context manager that ends it.

    Args:
        module: what the process runs: it has to `serve`.
        does: what is missing without it, for errors.
        files: as for `child`.
    """

    def __init__(self, module: str, does: str, *files: int) -> None:
        self._does = does
        self._process, self._connection = child(module, *files)

    def send(self, message: object) -> None:
        """A message for it. Raises a UsageError if the process has ended."""
        try:
            self._connection.send(message)
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.end()
        self._connection.close()

    def _ended(self) -> UsageError:
        return UsageError(f"the process that {self._does} has ended: the memory may be full")


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
