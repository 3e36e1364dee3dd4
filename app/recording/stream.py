"""The channel a recording is written through: Rerun's stream to a file, to viewers, to both or to nothing."""

import json
import operator
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from threading import Thread

import numpy as np
import rerun as rr

from app.arrays import Array, Floats
from app.recording import entities
from app.recording.blueprint import blueprint
from app.recording.columns import Columns, Kind, Values
from app.terminal.errors import UsageError

FLUSH_SECONDS = 10.0  # a viewer that hangs must not stop a run
BATCH_ROWS = 30  # written together: a killed recorder loses so many frames
VIEWED_SENDS = 100  # between two looks at the disk with a viewer, where everything is sent by itself
FULL_BYTES = 2**20  # so little left on a disk explains a failure

Loggable = rr.AsComponents | Iterable[rr.DescribedComponentBatch]


class Stream:
    """Rerun's RecordingStream with our timelines, and its failures as `UsageError`.

    Args:
        path: the .rrd file, or None.
        urls: viewers that listen.
    """

    def __init__(self, path: Path | None, urls: list[str]) -> None:
        self._path = path
        self._columns, self._at = Columns(), (0, 0.0)
        # A viewer wants everything at once.
        self._batch, self._flushed_after = (1, VIEWED_SENDS) if urls else (BATCH_ROWS, 1)
        self._sends = 0
        sinks: list[rr.FileSink | rr.GrpcSink] = [rr.GrpcSink(url) for url in dict.fromkeys(urls)]
        if path is not None:
            sinks.append(rr.FileSink(path))
        self._stream = rr.RecordingStream(entities.APPLICATION) if sinks else None
        if self._stream is None:
            return
        try:
            self._stream.set_sinks(*sinks, default_blueprint=blueprint(live=bool(urls)))
        except RuntimeError as error:
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
            self._send(self._stream)
            self._sends += 1
            if self._sends % self._flushed_after == 0:  # a full disk is noticed
                self._flush(self._stream)

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

    def close(self) -> None:
        """Complete the file; without it, `rerun rrd verify` refuses it.

        Raises:
            UsageError: it could not be written.
        """
        stream, self._stream = self._stream, None
        if stream is None:
            return
        try:
            self._flush(stream)
        except UsageError:
            # Rerun may wait for ever for a file that it could not write.
            Thread(target=stream.disconnect, daemon=True).start()
            raise
        stream.disconnect()

    def _send(self, stream: rr.RecordingStream) -> None:
        for piece in self._columns.taken():
            rr.send_columns(piece.entity, piece.times, piece.columns, recording=stream)

    def _flush(self, stream: rr.RecordingStream) -> None:
        """Wait until everything is on its way to the disk; a viewer that was closed meanwhile is no failure."""
        self._send(stream)
        try:
            stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            if "gRPC" not in str(error):
                raise self._failure(error) from error

    def _failure(self, error: RuntimeError) -> UsageError:
        full = self._path is not None and shutil.disk_usage(self._path.parent).free < FULL_BYTES
        reason = "the disk is full" if full else str(error)
        return UsageError(f"cannot write {self._path}: {reason}; choose another place with --out")
