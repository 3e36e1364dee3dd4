"""Locks on files and folders: two programs do not write to one place. They end with the process that holds them."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.terminal.errors import UsageError


@contextmanager
def locked(path: Path, text: str) -> Iterator[None]:
    """A file or folder is ours alone inside.

    Args:
        path: where it is.
        text: of the error.

    Raises:
        UsageError: somebody else holds it.
    """
    number = os.open(path, os.O_RDONLY)
    try:
        if not taken(number):
            raise UsageError(text)
        yield
    finally:
        os.close(number)


def check_unlocked(path: Path) -> None:
    """Check that nobody is writing a file.

    Raises:
        UsageError: somebody is.
        OSError: it cannot be opened for writing.
    """
    number = os.open(path, os.O_RDWR)
    try:
        if not taken(number, fcntl.LOCK_SH):  # others may look, too
            raise UsageError(f"{path} is being written by another run: wait for it, or choose another name")
    finally:
        os.close(number)


def taken(number: int, kind: int = fcntl.LOCK_EX) -> bool:
    """Lock an open file, by its number, as long as it is open; whether that was possible."""
    try:
        fcntl.flock(number, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # this file system has no locks
        return True
    return True
