"""A surface is found anywhere in a picture, and another one is not."""

import cv2
import numpy as np
import pytest

from tests.tracking.scene import SIZE, moved, texture, tilt
from tracking.features import detect_corners
from tracking.region.mask import region_mask
from tracking.relocalisation import Relocalisation

IMAGE = texture()
POINTS = detect_corners(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY), region_mask(SIZE, (70, 55, 180, 130)), 250)
ELSEWHERE = texture(seed=9)


def scene(k: float) -> tuple[np.ndarray, np.ndarray]:
    """The picture at time k and where the points are in it."""
    forward, backward = tilt(k)
    return moved(IMAGE, backward), forward(POINTS)


def rough(found: np.ndarray | None, truth: np.ndarray) -> float:
    assert found is not None
    return float(np.nanpercentile(np.linalg.norm(found - truth, axis=1), 90))


@pytest.mark.parametrize("k", [0.0, 0.4, 0.8, 1.2])
def test_a_turned_surface_is_found_by_its_features(k: float) -> None:
    image, truth = scene(k)
    assert rough(Relocalisation(IMAGE, POINTS).find(image), truth) < 5.0


def test_half_of_a_surface_is_enough() -> None:
    image, truth = scene(0.5)
    image[:, : SIZE[0] // 2] = ELSEWHERE[:, : SIZE[0] // 2]
    found = Relocalisation(IMAGE, POINTS).find(image)
    assert rough(found, truth) < 8.0


@pytest.mark.parametrize("seed", range(1, 6))
def test_another_surface_is_not_taken_for_it(seed: int) -> None:
    relocalisation = Relocalisation(IMAGE, POINTS)
    assert relocalisation.find(texture(seed)) is None
    assert relocalisation.find(np.zeros_like(IMAGE)) is None
