from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.tracking.scene import SIZE, texture
from tracking import TrackingError
from tracking.features import BORDER_PX, MIN_SPACING_PX, detect_corners
from tracking.region.mask import region_mask

WHOLE = region_mask(SIZE)


def gray(seed: int = 0) -> np.ndarray:
    return cv2.cvtColor(texture(seed), cv2.COLOR_BGR2GRAY)


def nearest(points: np.ndarray) -> np.ndarray:
    distance = np.abs(points[:, None] - points[None]).max(axis=-1)
    np.fill_diagonal(distance, np.inf)
    return distance.min(axis=1)


@pytest.mark.parametrize("max_points", [50, 200, 500])
def test_finds_about_as_many_as_asked_apart_and_inside(max_points: int) -> None:
    points = detect_corners(gray(), WHOLE, max_points)
    assert 0.75 * max_points <= len(points) <= max_points
    assert nearest(points).min() >= MIN_SPACING_PX
    assert np.all(points >= BORDER_PX)
    assert np.all(points <= np.array(SIZE) - 1 - BORDER_PX)


def test_only_in_the_region() -> None:
    region = region_mask(SIZE, (100, 60, 90, 80))
    points = detect_corners(gray(), region, 100)
    assert np.all(region[points[:, 1].astype(int), points[:, 0].astype(int)] == 255)


def test_weak_texture_gets_its_share() -> None:
    weak = gray().astype(float)
    weak[:, 160:] = 128 + 0.12 * (weak[:, 160:] - 128)
    points = detect_corners(weak.astype(np.uint8), WHOLE, 300)
    right = np.count_nonzero(points[:, 0] > 165)
    assert right > 0.3 * len(points)


@pytest.mark.parametrize("sigma", [0.0, 1.0, 4.0, 10.0])
def test_no_corners_on_flat_noise(sigma: float) -> None:
    noise = np.random.default_rng(0).normal(100.0, sigma, SIZE[::-1]) if sigma else np.zeros(SIZE[::-1])
    with pytest.raises(TrackingError, match=r"only \d+ corners found in the region, at least 12"):
        detect_corners(noise.astype(np.uint8), WHOLE, 800)


def test_a_textured_part_of_a_noisy_picture_is_found() -> None:
    picture = np.random.default_rng(0).normal(100.0, 4.0, SIZE[::-1])
    picture[80:160, 100:220] += gray()[80:160, 100:220] - 128.0
    points = detect_corners(picture.clip(0, 255).astype(np.uint8), WHOLE, 200)
    on_texture = (np.abs(points - [160, 120]) <= [64, 44]).all(axis=1)
    assert on_texture.mean() > 0.95


def test_a_region_inside_the_border_only_is_an_error() -> None:
    with pytest.raises(TrackingError, match="only 0 corners"):
        detect_corners(gray(), region_mask(SIZE, (0, 0, BORDER_PX, 240)), 800)


@pytest.mark.parametrize("scale", [2, 3])
def test_larger_pictures_get_the_same_coverage(scale: int) -> None:
    small = detect_corners(gray(), WHOLE, 150)
    large_picture = cv2.resize(gray(), None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    large = detect_corners(large_picture, cv2.resize(WHOLE, None, fx=scale, fy=scale), 150)
    assert len(large) > 0.75 * len(small)
    cells = [{tuple(c) for c in np.floor(p / np.array(SIZE) * 4).astype(int)} for p in (small, large / scale)]
    assert len(cells[0] & cells[1]) >= 15


@pytest.mark.parametrize(
    ("name", "roi", "least"),
    [("kinect_paper", (195, 95, 325, 265), 600), ("talking_face", (115, 70, 130, 160), 250)],
)
def test_real_footage_has_enough(shared_data: Path, name: str, roi: tuple[int, int, int, int], least: int) -> None:
    capture = cv2.VideoCapture(str(shared_data / f"{name}.mp4"))
    picture = cv2.cvtColor(capture.read()[1], cv2.COLOR_BGR2GRAY)
    points = detect_corners(picture, region_mask((picture.shape[1], picture.shape[0]), roi), 800)
    assert least <= len(points) <= 800
