import cv2
import numpy as np
import pytest

from tests.tracking.scene import SIZE, moved, texture, tilt
from tracking.appearance import Appearance, Fusion
from tracking.features import detect_corners
from tracking.region.mask import region_mask

IMAGE = texture()
POINTS = detect_corners(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY), region_mask(SIZE, (60, 50, 200, 140)), 150)
ALL = np.arange(len(POINTS))


def picture(image: np.ndarray) -> np.ndarray:
    return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)


@pytest.mark.parametrize(("gain", "offset", "slope"), [(1, 0, 0), (0.5, 60, 0), (1.4, -50, 0), (1, 0, 6)])
def test_finds_a_tilted_patch_whatever_the_light(gain: float, offset: float, slope: float) -> None:
    forward, backward = tilt(1.0)
    now = gain * picture(moved(IMAGE, backward)) + offset + slope * np.arange(SIZE[0], dtype=np.float32)
    truth = forward(POINTS)
    affine = np.stack([forward(POINTS + e) - truth for e in np.eye(2)], axis=2)
    guess = truth + np.random.default_rng(0).uniform(-1.5, 1.5, truth.shape)
    found = Appearance(picture(IMAGE), POINTS, 7).align(now, guess, affine, ALL, 4)
    error = np.linalg.norm(found.points_px - truth, axis=1)
    assert np.median(error) < 0.1
    assert np.mean(error < 0.3) > 0.9
    assert np.median(found.score) > 0.95
    assert np.median(found.score_before) < np.median(found.score) - 0.1

    upright = np.broadcast_to(np.eye(2), affine.shape)
    unaware = Appearance(picture(IMAGE), POINTS, 7).align(now, truth, upright, ALL, 0)
    assert np.median(unaware.score) < 0.9  # the affine map is needed


def test_other_places_are_unlike() -> None:
    appearance = Appearance(picture(IMAGE), POINTS, 7)
    upright = np.broadcast_to(np.eye(2), (len(POINTS), 2, 2))
    found = appearance.align(picture(texture(seed=9)), POINTS, upright, ALL, 3)
    assert np.mean(found.score > 0.75) < 0.05
    flat = appearance.align(np.full(SIZE[::-1], 128, np.float32), POINTS, upright, ALL, 3)
    assert np.all(np.abs(flat.score) < 1e-3)
    assert np.isfinite(flat.points_px).all()


def test_a_subset_keeps_its_own_patches() -> None:
    appearance = Appearance(picture(IMAGE), POINTS, 7)
    which = ALL[::-7]
    upright = np.broadcast_to(np.eye(2), (len(which), 2, 2))
    found = appearance.align(picture(IMAGE), POINTS[which] + 0.7, upright, which, 3)
    np.testing.assert_allclose(found.points_px, POINTS[which], atol=0.05)
    nothing = appearance.align(picture(IMAGE), np.empty((0, 2)), np.empty((0, 2, 2)), ALL[:0], 3)
    assert nothing.points_px.shape == (0, 2)


def test_points_look_as_they_were_learnt() -> None:
    forward, backward = tilt(1.0)
    truth = forward(POINTS)
    affine = np.stack([forward(POINTS + e) - truth for e in np.eye(2)], axis=2)
    other = moved(texture(seed=9), backward)
    appearance = Appearance(picture(IMAGE), POINTS, 7)
    appearance.learn(picture(other), truth[::2], affine[::2], ALL[::2])
    found = appearance.align(picture(other), truth + 0.7, affine, ALL, 4)
    np.testing.assert_allclose(found.points_px[::2], truth[::2], atol=0.05)
    assert np.median(found.score[1::2]) < 0.5


def test_along_an_edge_a_place_is_unsure() -> None:
    image = np.full(SIZE[::-1], 100, np.float32)
    image[:, 160:] = 150
    noise = np.random.default_rng(0).normal(0, 2, (2, *image.shape)).astype(np.float32)
    points = np.array([[160.0, y] for y in range(40, 200, 20)])
    upright = np.broadcast_to(np.eye(2), (len(points), 2, 2))
    found = Appearance(cv2.GaussianBlur(image, (0, 0), 1.5) + noise[0], points, 7).align(
        cv2.GaussianBlur(image, (0, 0), 1.5) + noise[1], points, upright, np.arange(len(points)), 2
    )
    assert np.all(found.covariance[:, 1, 1] > 5 * found.covariance[:, 0, 0])
    np.testing.assert_allclose(found.sigma_px, np.sqrt(found.covariance[:, 1, 1]), rtol=0.1)


def test_places_are_joined_by_how_sure_they_are() -> None:
    where = Fusion(np.zeros((3, 2)))
    across = np.broadcast_to(np.diag([1.0, 1e6]), (3, 2, 2))
    along = np.broadcast_to(np.diag([1e6, 1.0]), (3, 2, 2))
    where.add(np.full((3, 2), 4.0), across, np.array([True, True, False]))
    where.add(np.full((3, 2), 2.0), along, np.array([True, False, False]))
    np.testing.assert_allclose(where.points_px, [[4, 2], [4, 4], [0, 0]], atol=1e-5)
