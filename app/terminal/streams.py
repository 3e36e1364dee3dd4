"""What a person reads is written to: closed, full, or of few letters, it must not end the work."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from typing import Any, TextIO, cast

from rich.console import Console

from app.terminal.errors import UsageError
from app.terminal.exit_code import ExitCode


class Unheard:
    """A stream that nobody may read: what cannot be written is left out.

    Args:
        stream: where it goes.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write it, if that is possible."""
        with suppress(OSError, ValueError):
            return self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """The same."""
        with suppress(OSError, ValueError):
            self._stream.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def prepare() -> None:
    """Letters that a terminal lacks become question marks, and nobody need read what is written."""
    sys.stdout = sys.stdout or os.fdopen(1, "w")
    sys.stderr = sys.stderr or os.fdopen(2, "w")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="replace")
    if not isinstance(sys.stderr, Unheard):
        sys.stderr = cast(TextIO, Unheard(sys.stderr))


@contextmanager
def standard_output() -> Iterator[None]:
    """What is written inside arrives, or that is told; whoever stops reading has read enough.

    Raises:
        UsageError: it cannot be written.
    """
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what is left is written at the end, too
        if isinstance(error, BrokenPipeError):
            sys.exit(ExitCode.DONE)
        raise UsageError(f"the output cannot be written: {error.strerror}; what was asked for is done") from error


class Tables(Console):
    """Where tables go: names of files may hold what looks like markup."""

    def __init__(self) -> None:
        super().__init__(markup=False, highlight=False)

    def on_broken_pipe(self) -> None:
        """The error goes on to `standard_output`."""
        raise BrokenPipeError
