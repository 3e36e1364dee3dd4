"""Videos keep the times of their frames."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.files.video_out import PacedVideo, writable_video
from app.terminal.errors import UsageError
from tracking.video import Video

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]


def frames_of(path: Path) -> list[Image]:
    with Video(str(path)) as video:
        return [frame.image for frame in video]


def test_frames_of_uneven_times_keep_them(tmp_path: Path) -> None:
    path = tmp_path / "uneven.mp4"
    with writable_video(path, (64, 48), 10.0) as sink, PacedVideo(sink, 10.0) as paced:
        for level, time_s in ((40, 5.0), (90, 5.1), (140, 5.4), (150, 5.41), (190, 5.5)):
            paced.write(np.full((48, 64, 3), level, np.uint8), time_s)
    levels = [float(frame.mean()) for frame in frames_of(path)]
    assert np.abs(np.array(levels) - (40, 90, 90, 90, 150, 190)).max() < 4


def test_a_video_without_frames_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"cannot write .*empty\.webm: there is no frame"), \
         writable_video(tmp_path / "empty.webm", (64, 48), 10.0):  # fmt: skip
        pass
    assert list(tmp_path.iterdir()) == []
