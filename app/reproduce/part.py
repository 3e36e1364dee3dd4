"""Progress of a part of the work: silent, but for what it adds to the whole."""

from collections.abc import Callable
from types import TracebackType
from typing import Self

from app.terminal.progress import Progress


class Part(Progress):
    """In place of a bar of its own, calls `advanced` at every frame."""

    def __init__(self, advanced: Callable[[], None] = lambda: None) -> None:
        self._advanced = advanced

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        pass

    def expect(self, frames: int | None) -> None:
        """Known to the whole already."""

    def advance(self, phase: str, error_px: float | None = None) -> None:  # noqa: ARG002
        """One frame more."""
        self._advanced()

    def at(self, done: int, total: int) -> None:
        """Not shown."""

    def log(self, text: str) -> None:
        """Not shown: it is in the results."""
