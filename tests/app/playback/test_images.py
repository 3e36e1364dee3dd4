"""The pictures of a recording."""

from pathlib import Path

import cv2

from app.playback.playback import Playback
from tests.synthetic_run import write_run


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
