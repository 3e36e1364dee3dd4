import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tracking import TrackingError
from tracking.region.mask import outline, region_mask
from tracking.region.surface import surface_mask

SIZE = (64, 48)


def write(path: Path, mask: np.ndarray) -> Path:
    cv2.imwrite(str(path), mask)
    return path


def test_everything_without_rectangle_and_mask() -> None:
    region = region_mask(SIZE)
    assert region.shape == (48, 64)
    assert np.all(region == 255)


def test_a_rectangle_is_x_y_width_height() -> None:
    expected = np.zeros((48, 64), np.uint8)
    expected[20:48, 10:40] = 255
    np.testing.assert_array_equal(region_mask(SIZE, (10, 20, 30, 28)), expected)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_a_mask_and_what_lies_in_both(tmp_path: Path, channels: int) -> None:
    mask = np.zeros((48, 64), np.uint8)
    mask[:, :32] = 255
    picture = mask if channels == 1 else np.repeat(mask[..., None], channels, axis=2)
    path = write(tmp_path / "mask.png", picture)
    np.testing.assert_array_equal(region_mask(SIZE, None, path), mask)
    both = region_mask(SIZE, (20, 0, 40, 10), path)
    assert np.count_nonzero(both) == 12 * 10


@pytest.mark.parametrize(
    "roi", [(50, 0, 20, 10), (0, 40, 10, 10), (-1, 0, 5, 5), (0, -1, 5, 5), (100, 100, 5, 5), (0, 0, 0, 5)]
)
def test_a_rectangle_outside_the_picture(roi: tuple[int, int, int, int]) -> None:
    with pytest.raises(TrackingError, match="leaves the picture of 64x48 px"):
        region_mask(SIZE, roi)


def test_masks_that_cannot_be_used(tmp_path: Path) -> None:
    black = write(tmp_path / "black.png", np.zeros((48, 64), np.uint8))
    other = write(tmp_path / "other.png", np.full((64, 48), 255, np.uint8))
    left = np.zeros((48, 64), np.uint8)
    left[:, :10] = 255
    half = write(tmp_path / "half.png", left)
    text, empty = tmp_path / "text.png", tmp_path / "empty.png"
    text.write_text("no picture")
    empty.touch()
    table = [
        (tmp_path / "missing.png", None, "no mask file {}"),
        (text, None, "{} is not a picture"),
        (empty, None, "{} is not a picture"),
        (other, None, "{} has 48x64 px, the video 64x48"),
        (black, None, "{} is black"),
        (half, (30, 10, 10, 10), "{} within the region 30 10 10 10 is black"),
    ]
    for path, roi, says in table:
        with pytest.raises(TrackingError, match=re.escape(says.format(path))):
            region_mask(SIZE, roi, path)


def test_the_outline_of_a_rectangle_is_closed_and_on_its_border() -> None:
    (line,) = outline(region_mask(SIZE, (10, 20, 30, 28)))
    np.testing.assert_array_equal(line[0], line[-1])
    np.testing.assert_array_equal((line.min(axis=0), line.max(axis=0)), ((10, 20), (39, 47)))


def test_the_whole_picture_has_no_outline() -> None:
    assert outline(region_mask(SIZE)) == []


def test_points_among_others_have_a_surface_however_scattered() -> None:
    region = np.full((240, 320), 255, np.uint8)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        place, own = rng.uniform(0, [319, 239], (200, 2)), np.arange(200) < rng.integers(4, 20)
        assert surface_mask(place, own, ~own, region).any()


def test_a_rectangle_and_corners_that_do_not_meet() -> None:
    with pytest.raises(TrackingError, match="do not meet"):
        region_mask(SIZE, (0, 0, 20, 20), None, [30, 30, 50, 30, 50, 40, 30, 40])


def test_a_hole_is_cut_for_what_has_left_the_picture_too() -> None:
    places = np.stack(np.meshgrid(np.arange(0.0, 200, 4), np.arange(0.0, 160, 4)), axis=2).reshape(-1, 2)
    around = np.linalg.norm(places - [150, 80], axis=1)
    own, others = (around > 30) & (around < 60), (around <= 30) | (places[:, 0] < 60)
    places[np.flatnonzero(others)[-1]] = 205.0, 80.0  # a tracker follows points a little farther
    mask = surface_mask(places, own, others, np.full((160, 200), 255, np.uint8))
    assert mask[80, 150] == 0
    assert mask[80, 110] == 255
