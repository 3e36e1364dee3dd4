"""Writing files: seen to before the work, and under their names only when complete."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from app.terminal.errors import UsageError


def check_free(path: Path | None, *, overwrite: bool) -> None:
    """See to it, before anything is computed, that a file can be written.

    Raises:
        UsageError: it exists and may not be replaced, or its folder cannot be made.
    """
    if path is None:
        return
    if path.exists() and not overwrite:
        raise UsageError(f"{path} exists: replace it with --overwrite, or choose another name")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new = not path.exists()
        path.open("ab").close()
        if new:  # and nothing else: a device is empty, too
            path.unlink()
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror}; choose another place") from error


@contextmanager
def writable(path: Path) -> Iterator[BinaryIO]:
    """A binary file that appears under its name only when complete.

    Raises:
        UsageError: the file cannot be written.
    """
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as file:
            yield file
        part.replace(path)
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror}; free some space or choose another place") from error
    finally:
        part.unlink(missing_ok=True)


def write_json(path: Path, words: Mapping[str, object]) -> None:
    """A JSON file; errors as of `writable`."""
    with writable(path) as file:
        file.write((json.dumps(words, indent=2) + "\n").encode())
