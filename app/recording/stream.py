"""The channel a recording is written through: Rerun's stream to a file, to viewers, to both or to nothing."""

import json
import shutil
import subprocess
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from pathlib import Path
from threading import Thread

import numpy as np
import rerun as rr
import rerun_cli  # type: ignore[import-untyped]
from numpy.typing import NDArray

from app.environment import environment
from app.files.writing import moved_when_complete
from app.recording import entities
from app.recording.blueprint import blueprint
from app.terminal.errors import UsageError

FLUSH_SECONDS = 10.0  # a viewer that hangs must not stop a run
TICK_S = 1.0  # between two writes to the file: fewer, larger pieces; a killed run loses so much
INDEXED_BYTES = 2 * 2**30  # larger recordings get no index: making it takes about twice as much memory
INDEX_S = 600.0  # at most; it takes some seconds
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
        sinks: list[rr.FileSink | rr.GrpcSink] = [rr.GrpcSink(url) for url in dict.fromkeys(urls)]
        if path is not None:
            sinks.append(rr.FileSink(path, write_footer=False))  # it would keep an index of all chunks in memory
        batches = rr.ChunkBatcherConfig(flush_tick=TICK_S) if not urls else None  # a viewer wants every frame at once
        self._stream = rr.RecordingStream(entities.APPLICATION, batcher_config=batches) if sinks else None
        if self._stream is None:
            return
        try:
            self._stream.set_sinks(*sinks, default_blueprint=blueprint())
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

    def at(self, index: int, time_s: float) -> None:
        """Everything but static data belongs to this frame from now on."""
        if self._stream is not None:
            self._stream.set_time(entities.FRAME, sequence=index)
            self._stream.set_time(entities.TIME, duration=time_s)

    def log(self, entity: str, what: Loggable, *, static: bool = False) -> None:
        """Write one of Rerun's archetypes."""
        if self._stream is not None:
            self._stream.log(entity, what, static=static)

    def static(self, entries: Iterable[tuple[str, Loggable]]) -> None:
        """Write what holds for the whole recording."""
        for entity, what in entries:
            self.log(entity, what, static=True)

    def values(self, entity: str, archetype: str, *, static: bool = False, **components: object) -> None:
        """Write components of our own, at full precision; viewers do not draw them, programs read them."""
        named = rr.DynamicArchetype(f"{entities.APPLICATION}.{archetype}", components=components)
        self.log(entity, named, static=static)

    def points(self, entity: str, points_px: NDArray[np.floating]) -> None:
        """Write points (n, 2) of the picture."""
        self.log(entity, rr.Points2D.from_fields(positions=points_px.astype(np.float32)))

    def document(self, entity: str, title: str, values: Mapping[str, object]) -> None:
        """Write values by name, as a table for people and as JSON for programs."""
        release = version("modeshape")
        rows = [f"| {name} | {value} |" for name, value in values.items()]
        text = "\n".join([f"# {title}", f"modeshape {release}", "", "| | |", "|---|---|", *rows])
        self.log(entity, rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN), static=True)
        self.values(entity, "Document", static=True, json=json.dumps(dict(values), default=str), version=release)

    def flush(self) -> None:
        """Wait until everything is on its way to the disk; a viewer that was closed meanwhile is no failure.

        Raises:
            UsageError: it could not be written.
        """
        if self._stream is not None:
            self._flush(self._stream)

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
        if self._path is not None:
            index(self._path)

    def _flush(self, stream: rr.RecordingStream) -> None:
        try:
            stream.flush(timeout_sec=FLUSH_SECONDS)
        except RuntimeError as error:
            if "gRPC" not in str(error):
                raise self._failure(error) from error

    def _failure(self, error: RuntimeError) -> UsageError:
        full = self._path is not None and shutil.disk_usage(self._path.parent).free < FULL_BYTES
        reason = "the disk is full" if full else str(error)
        return UsageError(f"cannot write {self._path}: {reason}; choose another place with --out")


def index(path: Path) -> None:
    """Add the index that makes a recording quick to open, and pack it; a file left without is as good, only slower.

    A process of its own reads the whole file for it, which is why that of very long recordings stays as it is.
    """
    program = Path(rerun_cli.__file__).with_name("rerun")
    try:
        if path.stat().st_size > INDEXED_BYTES or shutil.disk_usage(path.parent).free < path.stat().st_size + FULL_BYTES:
            return
        with moved_when_complete(path) as part:
            subprocess.run(
                [program, "rrd", "optimize", "--max-rows", "1", "--max-size", "1B", path, "-o", part],
                env=environment(),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                check=True,
                timeout=INDEX_S,
                start_new_session=True,  # Ctrl-C ends the run, not this
            )
    except (OSError, UsageError, subprocess.SubprocessError):
        pass
