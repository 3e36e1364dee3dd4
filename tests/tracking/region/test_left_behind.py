"""Points that stay where they are while the surface moves."""

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.tracking.scene import texture
from tracking.features import detect_corners
from tracking.guarded import GuardedTracker
from tracking.observation import Observation
from tracking.region.left_behind import FRAMES, LeftBehind

Array = NDArray[np.float64]
x, y = np.meshgrid(np.arange(0.0, 300, 15), np.arange(0.0, 200, 15))
POINTS = np.stack([x.ravel(), y.ravel()], axis=1)


def seen(points: Array) -> Observation:
    return Observation(points, np.isfinite(points[:, 0]))


def test_a_watermark_on_a_surface_that_moves_is_left_behind() -> None:
    watermark = (np.abs(POINTS - [250, 150]) < 40).all(axis=1)
    behind = LeftBehind(POINTS)
    found = [behind.look(seen(np.where(watermark[:, None], POINTS, POINTS + np.array([0.8 * k, 0.0])))) for k in range(60)]
    np.testing.assert_array_equal(behind.points, watermark)
    assert sum(found) == watermark.sum()
    assert found[: 12 + FRAMES] == [0] * (12 + FRAMES)  # it has to move first


def test_a_page_that_turns_keeps_the_part_that_lies() -> None:
    behind = LeftBehind(POINTS)
    for k in range(90):
        lift = np.clip(POINTS[:, 0] - 150, 0, None) ** 2 * k / 90 * 0.004  # from the fold on, as far as 90 px
        assert behind.look(seen(POINTS - np.stack([lift, 0.3 * lift], axis=1))) == 0


def test_what_hardly_moves_is_what_is_followed() -> None:
    moves = POINTS[:, 0] > 200
    behind = LeftBehind(POINTS)
    for k in range(60):
        assert behind.look(seen(np.where(moves[:, None], POINTS + np.array([float(k), 0.0]), POINTS))) == 0


def test_the_tracker_gives_them_up() -> None:
    cloth, mark = texture(1, (480, 320)), texture(2)

    def picture(k: int) -> NDArray[np.uint8]:
        image = cloth[k : k + 240, :320].copy()
        image[190:230, 30:130] = mark[190:230, 30:130]
        return image

    first = picture(0)
    points = detect_corners(cv2.cvtColor(first, cv2.COLOR_BGR2GRAY), np.full((240, 320), 255, np.uint8), 300)
    on_mark = ((points > [34, 194]) & (points < [126, 226])).all(axis=1)
    tracker, told, astray = GuardedTracker(first, points), [], np.zeros(len(points), np.bool_)
    for k in range(1, 50):
        guarded = tracker.track(picture(k))
        astray |= False if guarded.astray is None else guarded.astray
        told += [guarded.reason] if guarded.reason else []
    assert on_mark.sum() > 8
    assert not guarded.observation.visible[on_mark].any()
    assert astray[on_mark].any()  # others are lost before
    assert astray[~on_mark].mean() < 0.1
    assert any("stay behind" in text for text in told)
    assert not tracker.lost


def test_the_page_of_a_card_that_lies_is_kept_though_points_are_far_apart() -> None:
    points = 3 * POINTS
    behind = LeftBehind(points)
    for k in range(90):
        turned = np.clip(points[:, 0] - 400, 0, None) * k / 90  # about a crease: those 50 px from it go as far
        assert behind.look(seen(points - np.stack([turned, 0.3 * turned], axis=1))) == 0
