"""Writing files and folders: checked before the work, and under their names only when complete."""

import json
import os
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from secrets import token_hex
from tempfile import TemporaryDirectory, TemporaryFile
from typing import BinaryIO

from app.files.locks import check_unlocked
from app.files.names import free
from app.terminal.errors import UsageError

PROMISED: set[Path] = set()  # names that were free when a command began: what is there later is somebody's


def check_outputs(outputs: Mapping[str, Path | None], inputs: Iterable[Path | str | None], *, overwrite: bool) -> None:
    """Check, before anything is computed, that files can be written, and that none is another or one that is read.

    Args:
        outputs: by the option that names it.
        inputs: what is read, if it is a file.
        overwrite: whether files may be replaced.

    Raises:
        UsageError: as of `check_free`, or two are the same.
    """
    read = {identity(Path(one)) for one in inputs if one is not None and Path(one).is_file()}
    written: dict[object, str] = {}
    for option, path in outputs.items():
        if path is None:
            continue
        check_free(path, overwrite=overwrite)
        place = identity(path)
        if place in read:
            raise UsageError(f"{option} {path} is read from: choose another name")
        if place in written:
            raise UsageError(f"{written[place]} and {option} are the same file {path}: choose another name for one")
        written[place] = option


def identity(path: Path) -> object:
    """What is equal for two names of one file, links among them."""
    return (path.stat().st_dev, path.stat().st_ino) if path.exists() else path.resolve()


def check_free(path: Path | None, *, overwrite: bool) -> None:
    """Check, before anything is computed, that a file can be written.

    Raises:
        UsageError: it exists and may not be replaced, is no file at all, or its folder cannot be made.
    """
    if path is None:
        return
    try:
        if path.exists() and not path.is_file():
            raise UsageError(f"{path} is {'a folder' if path.is_dir() else 'no regular file'}: choose another name")
        if path.exists() and not overwrite:
            raise UsageError(f"{path} exists: replace it with --overwrite, or choose another name")
        if path.exists():
            check_unlocked(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=path.parent):  # the name itself may be somebody's by now
            pass
    except OSError as error:
        raise UsageError(f"cannot write {path}: {error.strerror}; choose another place") from error
    if overwrite:
        PROMISED.discard(path.resolve())
    else:
        PROMISED.add(path.resolve())


def check_free_folder(folder: Path, *, overwrite: bool) -> None:
    """Check, before anything is computed, that files can be written into a folder of their own.

    Raises:
        UsageError: there is something in it and may not be replaced, or it cannot be made.
    """
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{folder} is a file: choose another name for the folder")
    if folder.is_dir() and any(folder.iterdir()) and not overwrite:
        raise UsageError(f"{folder} exists: replace what is in it with --overwrite, or choose another name")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder if folder.is_dir() else folder.parent):
            pass
    except OSError as error:
        raise UsageError(f"cannot write {folder}: {error.strerror}; choose another place") from error


def unfinished(path: Path) -> Path:
    """A path beside another, with the same ending, that nobody else has: hidden, since *.rrd means finished ones."""
    return path.with_name(f".{token_hex(8)}.part{path.suffix}")


def place(part: Path, path: Path, *, overwrite: bool) -> None:
    """Give a file its name.

    Raises:
        UsageError: somebody took it meanwhile; the file is beside it.
    """
    if overwrite:
        part.replace(path)
        return
    try:
        os.link(part, path)  # unlike a renaming, replaces nothing
    except FileExistsError:
        other = free(path)
        part.replace(other)
        raise UsageError(f"{path} was written by somebody meanwhile: the result is in {other}") from None
    except OSError:  # no links on this file system
        part.replace(free(path))
    else:
        part.unlink()


@contextmanager
def moved_when_complete(path: Path) -> Iterator[Path]:
    """A path beside a file's, with the same ending, to write it to; the file is moved to its place if nothing fails.

    Raises:
        UsageError: the file cannot be written.
    """
    part = unfinished(path)
    try:
        part.open("x").close()
        yield part
        place(part, path, overwrite=path.resolve() not in PROMISED)
    except OSError as error:
        raise unwritable(path, error) from error
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def writable(path: Path) -> Iterator[BinaryIO]:
    """A binary file that appears under its name only when complete; errors as of `moved_when_complete`."""
    with moved_when_complete(path) as part, part.open("wb") as file:
        yield file


@contextmanager
def writable_folder(folder: Path, replaced: Iterable[str]) -> Iterator[Path]:
    """A folder to write files to, which appear in `folder` when all are there.

    Args:
        folder: where they belong.
        replaced: patterns of files of an earlier time, which are removed; the folder may hold anybody's others.

    Raises:
        UsageError: the files cannot be written.
    """
    part = unfinished(folder.resolve())
    try:
        part.mkdir()
        yield part
        folder.mkdir(exist_ok=True)
        for pattern in replaced:
            for old in folder.glob(pattern):
                old.unlink()
        for made in part.iterdir():
            made.replace(folder / made.name)
    except OSError as error:
        raise unwritable(folder, error) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)


def unwritable(path: Path, error: OSError) -> UsageError:
    """The error for a file or folder that could not be completed."""
    return UsageError(f"cannot write {path}: {error.strerror}; free some space or choose another place")


def write_json(path: Path, words: Mapping[str, object]) -> None:
    """A JSON file; errors as of `writable`."""
    with writable(path) as file:
        file.write((json.dumps(words, indent=2) + "\n").encode())
