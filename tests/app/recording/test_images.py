"""Pictures in a recording: JPEG, the video itself, or none."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.files.video_out import writable_video
from app.recording.images import embedded_video
from app.recording.recording import entities
from app.terminal.errors import UsageError
from tests.app.recording.rows import Rows, frame, read, record
from tests.synthetic_run import Run, write_run
from tracking.video import Video


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


def turned(path: Path) -> Path:
    """A clip whose file says that its pictures are to be turned by a quarter; bright above, as they are to be shown."""
    picture = np.full((96, 160, 3), 40, np.uint8)
    picture[:, :80] = 220
    with writable_video(path, (160, 96), 30.0) as sink:
        for k in range(5):
            sink.write(picture, k / 30)
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 44  # of the track's header, version 0
    quarter = (0, 1 << 16, 0, -1 << 16, 0, 0, 96 << 16, 0, 1 << 30)
    data[matrix : matrix + 36] = struct.pack(">9i", *quarter)
    path.write_bytes(data)
    return path


def test_a_video_that_is_to_be_turned_is_stored_upright(tmp_path: Path) -> None:
    video = turned(tmp_path / "turned.mp4")
    with Video(str(video)) as frames:
        shown = [frame.image for frame in frames]
    assert shown[0].shape == (160, 96, 3)
    asset, stamps = embedded_video(video)
    assert len(stamps) == 5
    copy = tmp_path / "copy.mp4"
    assert asset.blob is not None
    copy.write_bytes(bytes(asset.blob.as_arrow_array().to_pylist()[0]))
    with Video(str(copy)) as frames:
        stored = [frame.image for frame in frames]
    assert len(stored) == 5
    assert max(cv2.absdiff(a, b).mean() for a, b in zip(shown, stored, strict=True)) < 3
    assert abs(float(shown[0][:70].mean()) - float(shown[0][90:].mean())) > 150


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
