import re
import subprocess
import sys
import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracking import TrackingError
from tracking.video import Frame, Video

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


@pytest.fixture
def images(tmp_path: Path) -> Path:
    for i in range(7, 17):
        cv2.imwrite(str(tmp_path / f"img{i:04d}.png"), picture(i))
    return tmp_path / "img%04d.png"


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


def test_reads_numbered_images_that_start_anywhere(images: Path) -> None:
    found = frames(images)
    assert [int(f.image[0, 0, 0]) for f in found] == [8 * i for i in range(7, 17)]
    assert [f.index for f in found] == list(range(10))
    assert np.all(np.diff([f.time_s for f in found]) > 0)


def test_goes_on_past_damaged_images(images: Path) -> None:
    for i, data in ((9, b""), (10, b"no picture")):
        (images.parent / f"img{i:04d}.png").write_bytes(data)
    assert [f.index for f in frames(images)] == [0, 1, 4, 5, 6, 7, 8, 9]


@pytest.mark.parametrize("kind", ["gray", "alpha", "deep"])
def test_images_of_any_kind_become_bgr(tmp_path: Path, kind: str) -> None:
    base = {
        "gray": np.full((48, 64), 200, np.uint8),
        "alpha": np.full((48, 64, 4), 200, np.uint8),
        "deep": np.full((48, 64), 200 * 256, np.uint16),
    }[kind]
    cv2.imwrite(str(tmp_path / "i0.png"), base)
    (frame,) = frames(tmp_path / "i%d.png")
    assert frame.image.shape == (48, 64, 3)
    assert frame.image.dtype == np.uint8
    assert np.all(frame.image == 200)


def test_a_frame_of_another_size_is_fitted(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "i0.png"), picture(3))
    cv2.imwrite(str(tmp_path / "i1.png"), cv2.resize(picture(4), (128, 96)))
    assert [f.image.shape for f in frames(tmp_path / "i%d.png")] == [(48, 64, 3)] * 2


def test_a_single_image_is_a_video_of_one_frame(images: Path) -> None:
    assert len(frames(images.parent / "img0007.png")) == 1


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


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("missing.mp4", None, "no video file {}; check the path"),
        ("text.mp4", b"this is not a video\n" * 9, "{} cannot be decoded"),
        ("empty.mp4", b"", "{} cannot be decoded"),
        ("img%04d.png", None, "no image file matches {}"),
        ("nowhere/img%04d.png", None, "no image file matches {}"),
    ],
)
def test_names_a_source_that_cannot_be_read(tmp_path: Path, name: str, content: bytes | None, says: str) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(TrackingError, match=re.escape(says.format(path))) as error:
        Video(str(path))
    assert "\n" not in str(error.value)


def test_av1_is_read_or_told_how_to_convert() -> None:
    """The FFmpeg in OpenCV 5.0.0's wheel has no AV1 decoder, the one in 4.14.0's has."""
    if cv2.VideoCapture(str(AV1)).read()[0]:
        found = frames(AV1)
        assert [f.index for f in found] == [0, 1]
        assert abs(float(found[1].image.mean()) - 128) < 3
    else:
        with pytest.raises(TrackingError, match=r"av1\.mp4 is AV1 video.*ffmpeg -i .*av1\.mp4 -c:v libx264"):
            Video(str(AV1))


def test_a_folder_and_an_absent_camera(tmp_path: Path) -> None:
    with pytest.raises(TrackingError, match="is a folder"):
        Video(str(tmp_path))
    with pytest.raises(TrackingError, match="camera 97 cannot be opened"):
        Video("97")


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


def test_opencv_keeps_quiet(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("no video")
    code = (
        "import sys\nfrom tracking import TrackingError\nfrom tracking.video import Video\n"
        "for source in sys.argv[1:]:\n"
        "    try:\n        Video(source)\n    except TrackingError:\n        pass\n"
    )
    command = [sys.executable, "-c", code, str(AV1), str(tmp_path / "text.mp4"), "97"]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True)
    assert done.stdout + done.stderr == ""


def test_true_time_stamps_of_real_footage(shared_data: Path) -> None:
    found = frames(shared_data / "talking_face.mp4", 100, 103)
    np.testing.assert_allclose([f.time_s for f in found], np.arange(100, 103) / 24.0, atol=1e-3)
