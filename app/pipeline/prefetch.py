"""The next frame is fetched, and its optical flow begun, on another core while this one is reconstructed and recorded."""

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

from tracking.video import Frame

SWITCH_S = 0.0005  # after which one thread lets another: with Python's 5 ms, each of many short waits costs as much


class Prefetch:
    """A thread that is one frame ahead; a context manager, which does not wait for a source that is silent.

    Results do not depend on it: what is done ahead needs nothing of what goes on meanwhile.

    Args:
        frames: where they come from.
    """

    def __init__(self, frames: Iterator[Frame]) -> None:
        self._frames = frames
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="prefetch")
        self._fetched: Future[Frame | None] | None = None
        self._prepared: Future[None] | None = None

    def __enter__(self) -> Self:
        self._interval_s = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        sys.setswitchinterval(self._interval_s)
        self._thread.shutdown(wait=False, cancel_futures=True)

    def begin(self, prepare: Callable[[Frame], None]) -> None:
        """Go for the next frame, and do what can be done with it early; returns at once."""
        self._fetched = fetched = self._thread.submit(next, self._frames, None)
        self._prepared = self._thread.submit(prepare_fetched, prepare, fetched)

    def fetched(self) -> Frame | None:
        """The frame begun with, once it is there; None at the end of the source.

        Raises:
            whatever the source raises.
        """
        assert self._fetched is not None
        return self._fetched.result()

    def prepared(self) -> None:
        """Wait until the frame is prepared."""
        assert self._prepared is not None
        self._prepared.result()


def prepare_fetched(prepare: Callable[[Frame], None], fetched: "Future[Frame | None]") -> None:
    """Do it, unless there is no frame."""
    frame = None if fetched.exception() else fetched.result()
    if frame is not None:
        prepare(frame)
