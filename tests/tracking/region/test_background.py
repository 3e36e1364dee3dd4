"""A camera that moves, by what is at the picture's border."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.tracking.region.test_groups import grid, tracks
from tracking.region.background import by_first_camera

SIZE = (400, 300)
TURNED = np.array([[0.995, -0.02, 22.0], [0.02, 0.998, -9.0], [2e-5, -1e-5, 1.0]])  # what a camera's turn does


def seen_from(points: NDArray[np.float64], H: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cv2.perspectiveTransform(points[None], H)[0])


def test_its_motion_is_undone_and_what_moves_otherwise_is_left() -> None:
    points = grid()
    sheet = (np.abs(points - [200, 150]) < [70, 60]).all(axis=1)
    moved = seen_from(points + np.where(sheet[:, None], [15.0, 6.0], 0.0), TURNED)
    moved[5] = np.nan
    (first, now), camera_px = by_first_camera([points, moved], SIZE)
    seen = np.isfinite(now[:, 0])
    assert seen.sum() == len(points) - 1
    np.testing.assert_array_equal(first, points)
    np.testing.assert_allclose((now - points)[seen & ~sheet], 0.0, atol=0.05)
    np.testing.assert_allclose((now - points)[seen & sheet], [[15.0, 6.0]] * sheet.sum(), atol=0.05)
    border = (np.abs(points - [200, 150]) > [140, 105]).any(axis=1) & seen
    assert camera_px == pytest.approx(np.median(np.linalg.norm(moved - points, axis=1)[border]), rel=0.02)


def test_a_sheet_that_bends_at_the_border_is_no_camera() -> None:
    points = grid()
    x, y = ((points - [200, 150]) / 200).T
    W = tracks(points, np.stack([30 * y - 40 * x + 45 * x**2, 30 * np.sin(4 * x)], axis=1))
    found, camera_px = by_first_camera(list(W), SIZE)
    assert camera_px == 0.0
    np.testing.assert_array_equal(found, W)


def test_a_camera_that_stands_still_changes_nothing() -> None:
    points = grid()
    W = tracks(points, np.where((np.abs(points - [200, 150]) < [70, 60]).all(axis=1)[:, None], [30.0, 0.0], 0.0))
    found, camera_px = by_first_camera(list(W), SIZE)
    assert camera_px == 0.0
    np.testing.assert_array_equal(found, W)


def test_head_and_shoulders_before_a_plain_wall_are_no_background() -> None:
    points = grid()
    x, y = points.T
    person = points[(y > 205) | ((np.abs(x - 200) < 50) & (y > 60))]
    moved = seen_from(person, TURNED)
    found, camera_px = by_first_camera([person, moved], SIZE)
    assert camera_px == 0.0
    np.testing.assert_array_equal(found[1], moved)
