"""Models made by a process of their own, while frames go on."""

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, Self

from app.child import child, connection_to_parent
from app.terminal.errors import UsageError

NICE = 5  # frames go first


class MapProcess:
    """Calls functions in another process, one after the other; a context manager that ends it, whatever it does."""

    def __init__(self) -> None:
        self._process, self._connection = child("app.pipeline.map_process")
        self._calls = ThreadPoolExecutor(1, thread_name_prefix="map")  # sends, and waits for what comes back

    def begin(self, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        """Begin a call; the future's result raises what it raised, or a UsageError if the process has ended."""
        return self._calls.submit(self._call, function, *arguments)

    def close(self) -> None:
        """End the process; calls that it has not answered get a UsageError."""
        self._process.kill()
        self._process.wait()
        self._calls.shutdown(cancel_futures=True)
        self._connection.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def _call(self, function: Callable[..., Any], *arguments: object) -> Any:
        try:
            self._connection.send((function, arguments))
            failed, result = self._connection.recv()
        except (EOFError, OSError) as error:
            raise UsageError("the process that makes the models has ended: the memory may be full") from error
        if failed:
            raise result
        return result


def main() -> None:
    """What the other process does, until nobody listens any more."""
    connection: Connection = connection_to_parent()
    os.nice(NICE)
    import reconstruction.mapping.mapper  # noqa: F401 (takes its time: before the first call)

    try:
        while True:
            function, arguments = connection.recv()
            try:
                answer = False, function(*arguments)
            except Exception as error:  # raised in the run's process
                answer = True, error
            connection.send(answer)
    except (EOFError, OSError):
        os._exit(0)


if __name__ == "__main__":
    main()
