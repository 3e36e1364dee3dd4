"""Pictures in a recording: JPEG, the video itself, or none."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from app.recording.recording import Recording, entities
from app.terminal.errors import UsageError
from tests.synthetic_run import SIZE, Run, picture, write_run
from tracking.klt import Observation
from tracking.video import Frame

Rows = dict[tuple[str, str], dict[int | None, Any]]


@pytest.fixture(autouse=True)
def strict() -> Iterator[None]:
    """Wrongly shaped data only warns otherwise."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("run") / "sheet.rrd")


@pytest.fixture(scope="module")
def rows(run: Run) -> Rows:
    return read(run.path)


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


def test_frames_are_pictures(run: Run, rows: Rows) -> None:
    [blob] = rows[entities.IMAGE, "EncodedImage:blob"][5]
    decoded = cv2.imdecode(np.array(blob, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    assert np.abs(decoded.astype(int) - run.picture).mean() < 4


def test_the_video_file_can_stand_for_the_pictures(shared_data: Path, tmp_path: Path) -> None:
    video = shared_data / "kinect_paper.mp4"
    path = tmp_path / "video.rrd"
    with record(path, image="video", video=video) as recording:
        for index in range(3):
            recording.observe(*frame(index), phase="tracking")
    rows = read(path)
    [blob] = rows[entities.IMAGE, "AssetVideo:blob"][None]
    assert bytes(blob) == video.read_bytes()
    stamps = rows[entities.IMAGE, "VideoFrameReference:timestamp"]
    assert [stamps[index][0] for index in range(3)] == sorted({stamps[index][0] for index in range(3)})


def test_a_video_that_cannot_be_stored_is_an_error(tmp_path: Path) -> None:
    text = tmp_path / "text.mp4"
    text.write_text("not a video")
    for video in (None, text, tmp_path / "missing.mp4"):
        with pytest.raises(UsageError, match="--image jpeg"):
            record(tmp_path / "x.rrd", image="video", video=video)
    assert not (tmp_path / "x.rrd").exists()


def test_no_pictures_makes_a_small_file(tmp_path: Path, run: Run) -> None:
    small = write_run(tmp_path / "none.rrd", image="none")
    assert (entities.IMAGE, "EncodedImage:blob") not in read(small.path)
    assert small.path.stat().st_size < run.path.stat().st_size
