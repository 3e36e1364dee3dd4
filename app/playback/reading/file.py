"""Recordings are read in a process of its own: what a damaged one does to Rerun's reader ends that process alone."""

import os
import resource
import weakref
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import IO, Any

from app.playback.reading.rows import Row, Rows, Wanted
from app.processes.child import child, connection_to_parent
from app.terminal.errors import UsageError

PATIENCE_S = 60.0  # for the next piece of a file
MOST_BYTES = 8 * 2**30  # of memory for the process


class RecordingFile:
    """A recording on disk.

    Args:
        path: the .rrd file.

    Attributes:
        path: as given.
        cut_off: whether it ends in the middle of a message; what is complete is read.

    Raises:
        UsageError: it is missing, not a recording, damaged, or not one of ours.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._idle: list[Reader] = []
        reader = Reader(path)
        self.cut_off: bool = reader.answer()
        self._idle.append(reader)

    def rows(self, *wanted: Wanted) -> Rows:
        """The rows of all wanted components."""
        rows = Rows()
        for entity, component, found in self.pieces(*wanted):
            rows.found[entity, component] += found
        return rows

    def pieces(self, *wanted: Wanted) -> Iterator[tuple[str, str, list[Row]]]:
        """Entity, component and rows of all wanted components, piece by piece in the order of the file."""
        if self._idle:
            reader = self._idle.pop()
        else:
            reader = Reader(self.path)
            reader.answer()
        reader.ask(wanted)
        while (piece := reader.answer()) is not None:
            yield piece
        self._idle.append(reader)  # one that was left in the middle goes


class Reader:
    """The process; it goes when this object goes.

    Args:
        path: what it is to read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        part = NamedTemporaryFile(suffix=".rrd")  # noqa: SIM115 (here, since it must go however the process ends)
        process, self._connection = child("app.playback.reading.file")
        self.end = weakref.finalize(self, ended, process, self._connection, part)
        self.ask((path, Path(part.name)))

    def ask(self, message: object) -> None:
        """Send a message; answers may be many."""
        try:
            self._connection.send(message)
        except OSError as error:
            raise self._damaged("") from error

    def answer(self) -> Any:
        """The next answer.

        Raises:
            UsageError: the file cannot be read.
        """
        try:
            if not self._connection.poll(PATIENCE_S):
                raise self._damaged(f"nothing in {PATIENCE_S:.0f} s")
            answer = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._damaged("reading it ended the reader") from error
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _damaged(self, why: str) -> UsageError:
        return UsageError(f"{self._path} is damaged ({why}): run again to make another")


def ended(process: Any, connection: Connection, part: IO[bytes]) -> None:
    """End a reader."""
    connection.close()
    process.kill()
    process.wait()
    part.close()


def main() -> None:
    """What the process does: it opens a file, then sends what is wanted of it, until nobody listens any more."""
    from app.playback.reading.chunks import ChunkFile

    connection = connection_to_parent()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, resource.getrlimit(resource.RLIMIT_AS)[1]))
    try:
        path, part = connection.recv()
        try:
            file = ChunkFile(path, part)
            connection.send(file.cut_off)
            while True:
                wanted = connection.recv()
                for piece in file.pieces(*wanted):
                    connection.send(piece)
                connection.send(None)
        except UsageError as error:
            connection.send(error)
        except (EOFError, BrokenPipeError):
            raise
        except Exception as error:
            connection.send(UsageError(f"{path} is damaged ({' '.join(str(error).split())}): run again to make another"))
    except (EOFError, OSError):  # nobody listens any more
        pass
    os._exit(0)


if __name__ == "__main__":
    main()
