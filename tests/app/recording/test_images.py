"""Pictures in a recording: JPEG, the video itself, or none."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.recording.recording import entities
from app.terminal.errors import UsageError
from tests.app.recording.rows import Rows, frame, read, record
from tests.synthetic_run import Run, write_run


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
