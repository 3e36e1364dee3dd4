"""A file that is written for a long time, and may be read meanwhile: it has its name once there is something in it."""

import os
from pathlib import Path

from app.files.locks import check_unlocked, taken
from app.files.writing import PROMISED, place, unfinished
from app.terminal.errors import UsageError

OPEN_FILES = Path("/proc/self/fd")


class GrowingFile:
    """A file that nobody else may take the place of until it is closed. Without a name, it goes when its process goes.

    Args:
        path: its place.

    Attributes:
        path: where it is now, to be written by whoever likes in this process.

    Raises:
        UsageError: it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._place = self.path = path
        try:
            self._number = self._without_name()
        except OSError as error:
            raise UsageError(f"cannot write {path}: {error.strerror}; choose another place") from error
        taken(self._number)

    def show(self) -> None:
        """Move it to its place, if it is not there.

        Raises:
            UsageError: another run has written, or is writing there.
        """
        if self.path == self._place:
            return
        new = self._place.resolve() in PROMISED
        if self._place.exists():
            check_unlocked(self._place)
            if new:
                raise UsageError(f"{self._place} was written by somebody meanwhile: choose another name")
        if self.path.parent == OPEN_FILES:
            self.path = named(self._number, unfinished(self._place))
        place(self.path, self._place, overwrite=not new)
        self.path = self._place

    def close(self, *, keep: bool) -> None:
        """Let go of it, and remove it unless it is in its place, and is kept; a second time, nothing."""
        if self._number < 0:
            return
        if self.path.parent != OPEN_FILES and not (keep and self.path == self._place):
            self.path.unlink(missing_ok=True)
        os.close(self._number)
        self._number = -1

    def _without_name(self) -> int:
        """The number of a new, open file; with a hidden name where there are none without."""
        try:
            number = os.open(self._place.parent, os.O_TMPFILE | os.O_RDWR, 0o666)
        except (OSError, AttributeError):
            self.path = unfinished(self._place)
            return os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
        self.path = OPEN_FILES / str(number)
        return number


def named(number: int, path: Path) -> Path:
    """Give an open file its first name."""
    folder = os.open(OPEN_FILES, os.O_RDONLY)
    try:
        os.link(str(number), path, src_dir_fd=folder, follow_symlinks=True)
    finally:
        os.close(folder)
    return path
