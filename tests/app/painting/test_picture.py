"""Pictures and videos to paint."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.files.video_out import writable_video
from app.painting.picture import Texture, read_picture
from tests.app.card import card
from tracking.video import Video

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]


@pytest.fixture
def texture(tmp_path: Path) -> Path:
    path = tmp_path / "card.png"
    cv2.imwrite(str(path), card())
    return path


def frames_of(path: Path) -> list[Image]:
    with Video(str(path)) as video:
        return [frame.image for frame in video]


def test_a_video_moves_on_the_surface_and_begins_again(tmp_path: Path) -> None:
    path = tmp_path / "moving.mp4"
    with writable_video(path, (64, 48), 10.0) as sink:
        for k, level in enumerate((40, 90, 140, 190)):
            sink.write(np.full((48, 64, 3), level, np.uint8), k / 10)
    with Texture(path) as texture:
        shown = [texture.at(t)[..., :3].copy() for t in (0.0, 0.05, 0.1, 0.25, 0.39, 0.4, 0.75, 0.81, 4.35)]
    frames = frames_of(path)  # as compressed: the grey levels are off by a few
    assert len(frames) == 4
    for picture_, k in zip(shown, (0, 0, 1, 2, 3, 0, 3, 0, 3), strict=True):
        assert np.array_equal(picture_, frames[k])


def test_the_picture_s_own_size_and_alpha_are_read(tmp_path: Path) -> None:
    for name, picture_ in (
        ("grey", np.full((9, 7), 100, np.uint8)),
        ("deep", np.full((9, 7, 3), 100 * 257, np.uint16)),
        ("clear", np.dstack([np.full((9, 7, 3), 200, np.uint8), np.full((9, 7), 128, np.uint8)])),
    ):
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture_)
        with Texture(tmp_path / f"{name}.png") as texture:
            read = texture.at(0.0)
        assert read.shape == (9, 7, 4)
        assert np.abs(read[..., 0].astype(int) - 100).max() <= 1
        assert read[0, 0, 3] == (128 if name == "clear" else 255)


def test_a_photograph_is_as_its_camera_was_held(tmp_path: Path) -> None:
    whole, jpeg = np.full((40, 80, 3), 200, np.uint8), tmp_path / "photo.jpg"
    data = cv2.imencode(".jpg", whole)[1].tobytes()
    tiff = b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"  # orientation 6: a quarter turn
    exif = b"Exif\0\0" + tiff
    jpeg.write_bytes(data[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + data[2:])
    assert read_picture(jpeg).shape[:2] == (80, 40)
