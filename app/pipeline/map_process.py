"""Maps made by a process of their own, while frames go on."""

import os
import subprocess
import sys
from collections.abc import Callable
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from app.recording.environment import environment
from app.terminal.errors import UsageError


class MapProcess:
    """Calls functions in another process, which is started with the first call and ends with this object."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, function: Callable[..., Any], *arguments: object) -> Callable[[], Any]:
        """Begin a call; what is returned waits for its result."""
        if self._process is None:
            self._connection, theirs = Pipe()
            with theirs:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "app.pipeline.map_process", str(theirs.fileno())],
                    env=environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
                    stdin=subprocess.DEVNULL,
                    stdout=2,  # stderr: stdout is for the summary
                    pass_fds=[theirs.fileno()],
                    start_new_session=True,  # Ctrl-C ends the run, not this
                )
        self._connection.send((function, arguments))
        return self._result

    def close(self) -> None:
        """End the process, whatever it does."""
        process, self._process = self._process, None
        if process is not None:
            self._connection.close()
            process.kill()
            process.wait()

    def _result(self) -> Any:
        """The result of the oldest call.

        Raises:
            what the function raised.
        """
        try:
            result = self._connection.recv()
        except (EOFError, OSError) as error:
            raise UsageError("the process that makes maps has ended: the memory may be full") from error
        if isinstance(result, BaseException):
            raise result
        return result


def main() -> None:
    """What the other process does, until nobody listens any more."""
    os.set_inheritable(int(sys.argv[1]), False)
    connection = Connection(int(sys.argv[1]))
    try:
        while True:
            function, arguments = connection.recv()
            try:
                result = function(*arguments)
            except Exception as error:  # raised in the run's process
                result = error
            connection.send(result)
    except (EOFError, OSError):
        os._exit(0)


if __name__ == "__main__":
    main()
