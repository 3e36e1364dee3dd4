"""Numbered images as a video."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tracking import TrackingError
from tracking.sources.images import missing_numbers
from tracking.video import Frame, Video

AV1 = Path(__file__).with_name("data") / "av1.mp4"


def picture(i: int) -> np.ndarray:
    return np.full((48, 64, 3), 8 * i, np.uint8)


@pytest.fixture
def images(tmp_path: Path) -> Path:
    for i in range(7, 17):
        cv2.imwrite(str(tmp_path / f"img{i:04d}.png"), picture(i))
    return tmp_path / "img%04d.png"


def frames(source: Path, first: int = 0, stop: int | None = None) -> list[Frame]:
    with Video(str(source), first, stop) as video:
        return list(video)


def test_reads_numbered_images_that_start_anywhere(images: Path) -> None:
    found = frames(images)
    assert [int(f.image[0, 0, 0]) for f in found] == [8 * i for i in range(7, 17)]
    assert [f.index for f in found] == list(range(10))
    assert np.all(np.diff([f.time_s for f in found]) > 0)


def test_goes_on_past_damaged_images(images: Path) -> None:
    for i, data in ((9, b""), (10, b"no picture")):
        (images.parent / f"img{i:04d}.png").write_bytes(data)
    assert [f.index for f in frames(images)] == [0, 1, 4, 5, 6, 7, 8, 9]


def test_frames_keep_their_numbers_where_images_are_missing(images: Path) -> None:
    (images.parent / "img0010.png").unlink()
    told: list[str] = []
    with Video(str(images), log=told.append) as video:
        found = list(video)
    assert [f.index for f in found] == [0, 1, 2, 4, 5, 6, 7, 8, 9]
    assert told == ["missing of the images img%04d.png: number 10; those frames are left out"]


@pytest.mark.parametrize(
    ("numbers", "missing"),
    [
        ([5], []),
        ([0, 10, 20, 30], []),
        ([*range(0, 200, 10), 210], [200]),
        ([3, 17, 18, 95, 400], []),  # they count something else
        ([*range(300), *range(400, 700)], []),  # another shot
    ],
)
def test_what_is_missing_among_numbers(numbers: list[int], missing: list[int]) -> None:
    assert missing_numbers(numbers) == missing


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


def test_a_percent_sign_in_the_name_is_one(tmp_path: Path) -> None:
    for i in range(3):
        cv2.imwrite(str(tmp_path / f"take 50%_{i:04d}.png"), picture(i))
    assert len(frames(tmp_path / "take 50%_%04d.png")) == 3


def test_images_that_cannot_be_read_are_left_out_and_told(tmp_path: Path) -> None:
    for i in range(60):
        cv2.imwrite(str(tmp_path / f"img{i:04d}.png"), picture(i % 30))
    for i in range(10, 50):
        (tmp_path / f"img{i:04d}.png").write_bytes(b"damaged")
    told: list[str] = []
    with Video(str(tmp_path / "img%04d.png"), log=told.append) as video:
        assert [frame.index for frame in video] == [*range(10), *range(50, 60)]
    assert "40 of 60 frames cannot be read" in told[-1]
    with pytest.raises(TrackingError, match=r"frame 20 of .* cannot be read"):
        Video(str(tmp_path / "img%04d.png"), 20, 21)
