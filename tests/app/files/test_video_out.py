"""Videos keep the times of their frames."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.files.video_out import PacedVideo, steady, writable_video
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


@pytest.mark.parametrize(
    ("times", "fps", "shown"),
    [
        ([0, 0.1, 0.2, 0.3], 10, [1, 1, 1, 1]),
        ([5, 5.1, 5.2, 5.5, 5.6], 10, [1, 1, 3, 1, 1]),
        ([0, 0.1, 0.1, 0.2, 0.3], 10, [1, 0, 1, 1, 1]),
        ([2.0], 25, [1]),
        ([0, 0, 0], 25, [1, 1, 1]),
    ],
)
def test_videos_keep_the_time(times: list[float], fps: float, shown: list[int]) -> None:
    rate, counts = steady(np.array(times, float))
    assert rate == pytest.approx(fps)
    assert counts.tolist() == shown
