"""Reading a recording's file row by row: complete, of a killed run, or cut off."""

import struct
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa  # type: ignore[import-untyped]
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader, StoreEntry

from app.playback.reading.rows import STATIC, Row, Wanted
from app.recording import entities
from app.terminal.errors import UsageError

ROW_ID = "rerun.controls.RowId"

STREAM_HEADER = 12  # bytes: RRF2, version, options
MESSAGE_HEADER = struct.Struct("<QQ")  # kind, length of what follows
END_MESSAGE = 0
LAST_KIND = 3


class ChunkFile:
    """A `RecordingFile` that is read in this process; an iterable of its chunks, which are read one at a time.

    Args:
        path: the .rrd file.
        part: where the complete messages of a file that ends in the middle of one are copied to.
    """

    def __init__(self, path: Path, part: Path) -> None:
        self.path = path
        self.cut_off = False
        if not path.is_file():
            raise UsageError(f"there is no recording {path}: make one with `modeshape run`")
        with path.open("rb") as file:
            if file.read(3) != b"RRF":
                raise UsageError(f"{path} is not a recording: give an .rrd file that `modeshape run` wrote")
        try:
            self._open(path)
        except RuntimeError:
            self._open_complete_part(part)

    def __iter__(self) -> Iterator[Chunk]:
        try:
            yield from self._reader.stream(store=self._store)
        except RuntimeError as error:
            raise self._damaged(error) from error

    def pieces(self, *wanted: Wanted) -> Iterator[tuple[str, str, list[Row]]]:
        """Entity, component and rows of all wanted components; entities are named without a leading slash."""
        for chunk in self:
            entity = chunk.entity_path.lstrip("/")
            of_entity = tuple(component for begin, component in wanted if entity.startswith(begin))
            if not of_entity:
                continue
            batch = chunk.to_record_batch()
            for component in batch.schema.names:
                if component.startswith(of_entity):
                    yield entity, component, column_rows(batch, component)

    def _open(self, path: Path) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a killed run has no footer, and can be read all the same
            self._reader = RrdReader(path)
            stores = self._reader.recordings()
        self._store = self._find_store(stores)

    def _find_store(self, stores: list[StoreEntry]) -> StoreEntry:
        for store in stores:
            if store.application_id == entities.APPLICATION:
                return store
        if not stores:
            raise UsageError(f"{self.path} contains no recording: give an .rrd file that `modeshape run` wrote")
        raise UsageError(
            f"{self.path} is a recording of another application ({stores[0].application_id}): "
            "give an .rrd file that `modeshape run` wrote"
        )

    def _open_complete_part(self, part: Path) -> None:
        """Read the complete messages of a file that ends in the middle of one, from a copy."""
        try:
            with self.path.open("rb") as source, part.open("wb") as copy:
                left = complete_bytes(source, self.path.stat().st_size)
                source.seek(0)
                while block := source.read(min(left, 2**20)):
                    copy.write(block)
                    left -= len(block)
        except OSError as error:
            raise UsageError(f"cannot read {self.path}: {error.strerror}") from error
        try:
            self._open(part)
        except RuntimeError as error:
            raise self._damaged(error) from error
        self.cut_off = True

    def _damaged(self, error: RuntimeError) -> UsageError:
        return UsageError(f"{self.path} is damaged ({error}): run again to make another")


def complete_bytes(file: BinaryIO, size: int) -> int:
    """Length of the beginning of a file of `size` bytes that consists of complete messages with data."""
    position = STREAM_HEADER
    while position + MESSAGE_HEADER.size <= size:
        file.seek(position)
        kind, length = MESSAGE_HEADER.unpack(file.read(MESSAGE_HEADER.size))
        following = position + MESSAGE_HEADER.size + length
        if kind == END_MESSAGE or kind > LAST_KIND or following > size:
            break
        position = following
    return min(position, size)


def column_rows(batch: pa.RecordBatch, component: str) -> list[Row]:
    """The rows of a batch that have a value of a component."""
    count = batch.num_rows
    names = batch.schema.names
    frames = batch.column(entities.FRAME).to_pylist() if entities.FRAME in names else [STATIC] * count
    times = batch.column(entities.TIME).cast(pa.int64()).to_numpy() / 1e9 if entities.TIME in names else np.zeros(count)
    column, ids = batch.column(component), batch.column(ROW_ID).to_pylist()
    return [Row(ids[k], frames[k], float(times[k]), cell(column[k].values)) for k in range(count) if column[k].is_valid]


def cell(instances: pa.Array) -> object:
    """The instances of one row: an array, a list of texts or records, or the bytes of a blob."""
    kind = instances.type
    if pa.types.is_string(kind) or pa.types.is_struct(kind):
        return instances.to_pylist()
    if pa.types.is_list(kind):
        return instances.flatten().to_numpy().tobytes()
    if pa.types.is_fixed_size_list(kind):
        return instances.flatten().to_numpy().reshape(-1, kind.list_size).copy()
    values: NDArray[np.generic] = instances.to_numpy(zero_copy_only=False)
    return values.copy()
