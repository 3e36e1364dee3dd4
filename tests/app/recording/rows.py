"""Recordings written for a test, and read back with Rerun."""

from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from app.recording.recording import Recording, entities
from tests.synthetic_run import SIZE, picture
from tracking.observation import Observation
from tracking.video import Frame

Rows = dict[tuple[str, str], dict[int | None, Any]]


def read(path: Path) -> Rows:
    """(entity, component) → frame, None for static → value; the last row of a frame counts."""
    values: Rows = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        names = batch.schema.names
        frames = batch[entities.FRAME].to_pylist() if entities.FRAME in names else [None] * batch.num_rows
        if entities.TIME in names:  # nanoseconds as numbers: Python's timedelta has none
            batch = batch.set_column(names.index(entities.TIME), entities.TIME, batch[entities.TIME].cast("int64"))
        for name in set(names) - {"rerun.controls.RowId", entities.FRAME}:
            for frame, value in zip(frames, batch[name].to_pylist(), strict=True):
                if value is not None:
                    values.setdefault((chunk.entity_path.strip("/"), name), {})[frame] = value
    return values


def record(path: Path | None, **options: Any) -> Recording:
    return Recording(path, configuration={}, size=SIZE, **options)


def frame(index: int = 0) -> tuple[Frame, Observation]:
    return Frame(index, index / 30, picture()), Observation(np.full((5, 2), 10.0), np.ones(5, bool))
