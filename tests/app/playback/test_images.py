"""The pictures of a recording."""

from pathlib import Path

import cv2
import numpy as np

from app.playback.images import JPEG, decoded
from app.playback.playback import Playback
from app.playback.reading.file import RecordingFile
from app.recording import entities
from tests.synthetic_run import SIZE, write_run


def test_pictures_come_one_by_one(tmp_path: Path) -> None:
    run = write_run(tmp_path / "sheet.rrd")
    pictures = dict(Playback.load(run.path).images())
    assert list(pictures) == list(range(6))
    for picture in pictures.values():
        assert picture is not None
        assert cv2.PSNR(picture, run.picture) > 30


def test_without_pictures(tmp_path: Path) -> None:
    run = write_run(tmp_path / "sheet.rrd", image="none")
    assert list(Playback.load(run.path).images()) == [(i, None) for i in range(6)]


def test_small_pictures_come_back_as_large_as_they_were(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run.rrd", image_width=SIZE[0] // 2)
    blobs = [row.value for _, _, rows in RecordingFile(run.path).pieces((entities.IMAGE, JPEG)) for row in rows]
    assert all(decoded(blob).shape == (SIZE[1] // 2, SIZE[0] // 2, 3) for blob in blobs)
    for _, picture in Playback.load(run.path).images():
        assert picture is not None
        assert np.median(np.abs(picture.astype(int) - run.picture)) < 4  # and in its place
        edge = np.abs(np.diff(picture[10:110, :, 0].astype(int), axis=1)).sum(axis=0)
        assert 28 <= edge.argmax() <= 31 or 78 <= edge.argmax() <= 81 or 128 <= edge.argmax() <= 131
