"""The stage that makes models, while frames go on."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Any, Self

from app.processes.child import NICEST, connection_to_parent
from app.processes.remote import Remote, packed, serve


class MapProcess:
    """Calls functions in another process, one after the other; a context manager that ends it, whatever it does.

    Args:
        waited_for: whether frames wait for it; else it takes what they leave.
    """

    def __init__(self, *, waited_for: bool = True) -> None:
        self._remote = Remote("app.pipeline.stages.maps", "makes the models", nice=0 if waited_for else NICEST)
        self._calls = ThreadPoolExecutor(1, thread_name_prefix="map")  # sends, and waits for what comes back

    def begin(self, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        """Begin a call; the future's result raises what it raised, or a UsageError if the process has ended."""
        return self._calls.submit(self._call, packed((function, arguments)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._remote.end()  # which ends a call that is waited for
        self._calls.shutdown(cancel_futures=True)
        self._remote.close()

    def _call(self, message: memoryview) -> Any:
        self._remote.send_packed(message)
        return self._remote.receive()


def main() -> None:
    """What the other process does, until nobody listens any more."""
    connection = connection_to_parent()
    import reconstruction.mapping.mapper  # noqa: F401 (takes its time: before the first call)

    serve(connection, lambda message: message[0](*message[1]))


if __name__ == "__main__":
    main()
