"""Frames with their times: files, ranges, ends."""

import threading
from collections import deque
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracking import TrackingError
from tracking.video import Frame, Video, leave_out_late

AV1 = Path(__file__).with_name("data") / "av1.mp4"


def picture(i: int) -> np.ndarray:
    return np.full((48, 64, 3), 8 * i, np.uint8)


@pytest.fixture
def movie(tmp_path: Path) -> Path:
    path = tmp_path / "movie.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for i in range(20):
        writer.write(picture(i))
    writer.release()
    return path


def frames(source: Path, first: int = 0, stop: int | None = None) -> list[Frame]:
    with Video(str(source), first, stop) as video:
        return list(video)


def test_delivers_every_frame_with_its_time(movie: Path) -> None:
    with Video(str(movie)) as video:
        assert video.size == (64, 48)
        assert video.frame_count == 20
        found = list(video)
    assert [f.index for f in found] == list(range(20))
    np.testing.assert_allclose([f.time_s for f in found], np.arange(20) / 25.0, atol=1e-6)
    for f in found:
        assert f.image.shape == (48, 64, 3)
        assert abs(float(f.image.mean()) - 8 * f.index) < 3


@pytest.mark.parametrize(("first", "stop", "expected"), [(5, 8, [5, 6, 7]), (18, 99, [18, 19]), (0, 1, [0])])
def test_delivers_the_range_that_is_asked_for(movie: Path, first: int, stop: int, expected: list[int]) -> None:
    with Video(str(movie), first, stop) as video:
        assert video.frame_count == len(expected)
        found = list(video)
    assert [f.index for f in found] == expected
    assert abs(float(found[0].image.mean()) - 8 * first) < 3
    assert found[0].time_s == pytest.approx(first / 25.0)


@pytest.mark.parametrize("leave_after", [0, 1, 5])
def test_leaving_early_ends_the_decoding_thread(movie: Path, leave_after: int) -> None:
    with Video(str(movie)) as video:
        for _, _frame in zip(range(leave_after), video, strict=False):
            pass
    assert not [t for t in threading.enumerate() if t.name == "decode"]
    assert list(video) == []
    video.close()


def test_an_error_while_iterating_ends_the_decoding_thread(movie: Path) -> None:
    def fail() -> None:
        with Video(str(movie)) as video:
            for _ in video:
                raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert not [t for t in threading.enumerate() if t.name == "decode"]


def test_only_frames_that_nobody_had_time_for_are_late() -> None:
    came = [Frame(k, time_s, picture(k)) for k, time_s in enumerate([0.0, 0.02, 0.04, 0.06])]
    waiting = deque[Frame | BaseException | None](came)
    leave_out_late(waiting, 0.05)
    assert len(waiting) == 4
    leave_out_late(waiting, 0.08)
    assert list(waiting) == came[2:]
    waiting = deque[Frame | BaseException | None]([None])
    leave_out_late(waiting, 9.0)
    assert list(waiting) == [None]


@pytest.mark.parametrize(
    ("first", "stop", "says"),
    [
        (20, None, "ends at frame 20"),
        (99, 120, "ends at frame 20"),
        (5, 5, "0 <= A < B"),
        (-3, 5, "0 <= A < B"),
    ],
)
def test_a_range_without_frames(movie: Path, first: int, stop: int | None, says: str) -> None:
    with pytest.raises(TrackingError, match=says):
        Video(str(movie), first, stop)


def test_true_time_stamps_of_real_footage(shared_data: Path) -> None:
    found = frames(shared_data / "talking_face.mp4", 100, 103)
    np.testing.assert_allclose([f.time_s for f in found], np.arange(100, 103) / 24.0, atol=1e-3)
