"""The channel a recording is written through: Rerun's stream to a file, to viewers, to both or to nothing."""

import atexit
import json
import operator
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from threading import Event, Thread

import numpy as np
import rerun as rr

from app.arrays import Array, Floats
from app.files.growing import GrowingFile
from app.recording import entities
from app.recording.blueprint import blueprint
from app.recording.columns import Columns, Kind, Values
from app.terminal.errors import UsageError

FLUSH_SECONDS = 10.0  # a viewer that hangs must not stop a run
BATCH_ROWS = 30  # written together: a killed recorder loses so many frames
VIEWED_SENDS = 100  # between two looks at the disk with a viewer, where everything is sent by itself
FULL_BYTES = 8 * 2**20  # so little left on a disk is too little: Rerun waits for ever for what it could not write

Loggable = rr.AsComponents | Iterable[rr.DescribedComponentBatch]


class Stream:
    """Rerun's RecordingStream with our timelines, and its failures as `UsageError`.

    Args:
        path: the .rrd file, or None.
        urls: viewers that listen.
    """

    def __init__(self, path: Path | None, urls: list[str]) -> None:
        self._path = path
        self._file = GrowingFile(path) if path is not None else None
        self._columns, self._at = Columns(), (0, 0.0)
        # A viewer wants everything at once.
        self._batch, self._flushed_after = (1, VIEWED_SENDS) if urls else (BATCH_ROWS, 1)
        self._sends = 0
        sinks: list[rr.GrpcSink | rr.FileSink] = [rr.GrpcSink(url) for url in dict.fromkeys(urls)]
        try:
            if self._file is not None:
                self._check_room()
                sinks.append(rr.FileSink(self._file.path))
            self._stream = rr.RecordingStream(entities.APPLICATION) if sinks else None
            if self._stream is None:
                return
            self._stream.set_sinks(*sinks, default_blueprint=blueprint(live=bool(urls)))
        except RuntimeError as error:
            if self._file is not None:
                self._file.close(keep=False)
            raise self._failure(error) from error
        self._stream.set_log_time_enabled(False)
        self._stream.set_log_tick_enabled(False)

    @property
    def open(self) -> bool:
        """Whether anybody reads what is written."""
        return self._stream is not None

    def name(self, name: str) -> None:
        """What viewers call the recording."""
        if self._stream is not None:
            self._stream.send_recording_name(name)

    @contextmanager
    def frame(self, index: int, time_s: float) -> Iterator[None]:
        """The rows that are written inside belong to this frame.

        Raises:
            UsageError: what was before could not be written.
        """
        self._at = operator.index(index), float(time_s)
        yield
        if self._stream is not None and self._columns.rows >= self._batch:
            self._sends += 1
            if self._sends % self._flushed_after:
                try:
                    self._send(self._stream)
                except RuntimeError as error:
                    raise self._failure(error) from error
            else:  # a full disk is noticed
                self._flush(self._stream)
                if self._file is not None:
                    self._file.show()

    def row(self, entity: str, kind: Kind, **values: Values) -> None:
        """Write a row, soon: components by name, made into columns by `kind`."""
        if self._stream is not None:
            self._columns.add(entity, kind, *self._at, values)

    def points(self, entity: str, points_px: Array | Floats) -> None:
        """Write a row of points (n, 2) of the picture."""
        self.row(entity, rr.Points2D.columns, positions=points_px.astype(np.float32))

    def scalars(self, entity: str, *values: float) -> None:
        """Write a row of numbers."""
        self.row(entity, rr.Scalars.columns, scalars=np.array(values, np.float64))

    def log(self, entity: str, what: Loggable) -> None:
        """Write what holds for the whole recording."""
        if self._stream is not None:
            self._stream.log(entity, what, static=True)

    def static(self, entries: Iterable[tuple[str, Loggable]]) -> None:
        """Write several things that hold for the whole recording."""
        for entity, what in entries:
            self.log(entity, what)

    def values(self, entity: str, archetype: str, **components: object) -> None:
        """Write components of our own that hold for the whole recording."""
        self.log(entity, rr.DynamicArchetype(f"{entities.APPLICATION}.{archetype}", components=components))

    def document(self, entity: str, title: str, values: Mapping[str, object]) -> None:
        """Write values by name, as a table for people and as JSON for programs."""
        release = version("modeshape")
        rows = [f"| {name} | {value} |" for name, value in values.items()]
        text = "\n".join([f"# {title}", f"modeshape {release}", "", "| | |", "|---|---|", *rows])
        self.log(entity, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN))
        self.values(entity, "Document", json=json.dumps(dict(values), default=str), version=release)

    def close(self, *, keep: bool) -> None:
        """Complete the file; without it, `rerun rrd verify` refuses it. One that is not kept is removed.

        Raises:
            UsageError: it could not be written.
        """
        try:
            self._complete()
            if keep and self._file is not None:
                self._file.show()
        finally:
            if self._file is not None:
                self._file.close(keep=keep)

    def _complete(self) -> None:
        if self._stream is not None:
            self._flush(self._stream)
        if self._stream is not None:
            self._stream.disconnect()
        self._stream = None

    def _send(self, stream: rr.RecordingStream) -> None:
        self._check_room()
        for piece in self._columns.taken():
            rr.send_columns(piece.entity, piece.times, piece.columns, recording=stream)

    def _flush(self, stream: rr.RecordingStream) -> None:
        """Wait until everything is on its way to the disk; a viewer that was closed meanwhile is no failure."""
        try:
            self._send(stream)
            stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            if "gRPC" in str(error):
                return
            self._stream = None  # Rerun waits for ever for a file that it could not write
            atexit.unregister(rr.rerun_shutdown)
            Thread(target=given_up, args=(stream,), daemon=True).start()
            raise self._failure(error) from error

    def _check_room(self) -> None:
        """Raises a RuntimeError if the disk is nearly full."""
        if self._path is not None and shutil.disk_usage(self._path.parent).free < FULL_BYTES:
            raise RuntimeError("the disk is full")

    def _failure(self, error: RuntimeError) -> UsageError:
        full = self._path is not None and shutil.disk_usage(self._path.parent).free < FULL_BYTES
        reason = "the disk is full" if full else str(error)
        return UsageError(f"cannot write {self._path}: {reason}; choose another place with --out")


def given_up(stream: rr.RecordingStream) -> None:
    """In a thread of its own: let go of a stream, whether that ever ends or not; it must not be tried again at the end."""
    stream.disconnect()
    Event().wait()
