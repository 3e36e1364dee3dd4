"""Losing the surface and finding it again."""

import pickle

import cv2
import numpy as np
import pytest

from tests.tracking.scene import SIZE, moved, texture, tilt
from tracking.features import detect_corners
from tracking.guarded import Change, Guarded, GuardedTracker, same_background
from tracking.region.mask import region_mask

IMAGE = texture()
POINTS = detect_corners(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY), region_mask(SIZE, (70, 55, 180, 130)), 250)
ELSEWHERE = texture(seed=9)


def scene(k: float) -> tuple[np.ndarray, np.ndarray]:
    """The picture at time k and where the points are in it."""
    forward, backward = tilt(k)
    return moved(IMAGE, backward), forward(POINTS)


def followed(to: float = 0.3) -> GuardedTracker:
    tracker = GuardedTracker(IMAGE, POINTS)
    for k in np.linspace(0.0, to, 5)[1:]:
        assert not tracker.track(scene(k)[0]).change.value.startswith("lost")
    return tracker


def right(guarded: Guarded, truth: np.ndarray) -> bool:
    seen = guarded.observation.visible
    return float(np.median(np.linalg.norm(guarded.observation.points_px - truth, axis=1)[seen])) < 0.3


def test_a_cut_is_noticed_at_once_and_the_surface_found_where_it_is_now() -> None:
    tracker = followed()
    image, truth = scene(1.3)
    image, truth = np.roll(image, 60, axis=1), truth + np.array([60.0, 0.0])  # too far for optical flow
    lost = tracker.track(image)
    assert lost.change is Change.LOST
    assert not lost.observation.visible.any()
    assert np.isnan(lost.observation.points_px).all()
    found = tracker.track(image)
    assert found.change is Change.RECOVERED
    assert found.observation.visible.mean() > 0.5
    assert right(found, truth)


def test_nothing_is_seen_while_something_else_is_in_the_picture() -> None:
    tracker = followed()
    for frame in range(40):
        now = tracker.track(ELSEWHERE)
        assert now.change is (Change.LOST if frame == 0 else Change.NONE)
        assert tracker.lost
        assert not now.observation.visible.any()
    image, truth = scene(0.6)
    found = [tracker.track(image) for _ in range(10)]
    assert sum(now.change is Change.RECOVERED for now in found) == 1
    assert not tracker.lost
    assert right(found[-1], truth)


def test_a_surface_that_leaves_the_picture_is_lost_and_comes_back() -> None:
    tracker = GuardedTracker(IMAGE, POINTS)
    changes = []
    for shift in [*range(0, 330, 10), *range(320, 0, -10)]:
        image = moved(IMAGE, lambda p, dx=shift: p - [dx, 0.0])
        image[:, : min(shift, SIZE[0])] = ELSEWHERE[:, : min(shift, SIZE[0])]
        truth = POINTS + np.array([shift, 0.0])
        now = tracker.track(image)
        seen = now.observation.visible
        assert not seen.any() or np.median(np.linalg.norm(now.observation.points_px - truth, axis=1)[seen]) < 0.5
        changes.append(now.change)
    assert changes.count(Change.LOST) == 1
    assert changes.count(Change.RECOVERED) == 1


@pytest.mark.parametrize("share", [0.4, 0.5])
def test_a_hand_at_once_over_part_of_it_is_no_loss(share: float) -> None:
    tracker = followed()
    edge = np.quantile(scene(0.3)[1][:, 0], share)
    for _ in range(10):
        image, _ = scene(0.3)
        image[:, : int(edge)] = ELSEWHERE[:, : int(edge)]
        assert tracker.track(image).change is Change.NONE


def test_it_goes_to_another_process_while_it_is_partly_covered() -> None:
    tracker = followed()
    image, truth = scene(0.3)
    covered = image.copy()
    edge = int(np.quantile(truth[:, 0], 0.2))
    covered[:, :edge] = ELSEWHERE[:, :edge]
    assert tracker.track(covered).observation.visible.mean() < 0.9  # features are described in a thread from here on
    there = pickle.loads(pickle.dumps(tracker))
    assert there.track(ELSEWHERE).change is Change.LOST
    found = there.track(np.roll(image, 60, axis=1))
    assert found.change is Change.RECOVERED
    assert right(found, truth + np.array([60.0, 0.0]))


def test_a_flash_costs_only_its_frames() -> None:
    tracker = followed()
    image, truth = scene(0.3)
    assert tracker.track(np.full_like(image, 255)).change is Change.LOST
    found = tracker.track(image)
    assert found.change is Change.RECOVERED
    assert found.observation.visible.mean() > 0.9
    assert right(found, truth)


def test_a_hand_that_comes_at_once_is_no_cut() -> None:
    image, truth = scene(0.3)
    covered, (x, y) = image.copy(), truth.astype(int).T
    sheet = np.s_[y.min() - 8 : y.max() + 8, x.min() - 8 : x.max() + 8]
    covered[sheet] = ELSEWHERE[sheet]
    lost = followed().track(covered)
    assert lost.change is Change.LOST
    assert not lost.cut
    lost = followed().track(ELSEWHERE)
    assert lost.change is Change.LOST
    assert lost.cut


def test_nothing_is_said_of_surroundings_that_are_not_in_the_picture() -> None:
    corners = np.array([[0.0, 0.0], [SIZE[0], 0.0], [0.0, SIZE[1]], list(SIZE)])
    assert not same_background(IMAGE, IMAGE, corners)
    assert same_background(IMAGE, IMAGE, 0.5 * corners)


def test_what_comes_into_sight_far_from_where_it_was_expected_is_found() -> None:
    tracker, cover = followed(), POINTS[:, 0] > np.quantile(POINTS[:, 0], 0.4)
    for k in np.linspace(0.3, 1.2, 12):
        image, _ = scene(float(k))
        image[:, int(np.quantile(POINTS[:, 0], 0.4)) :] = ELSEWHERE[:, int(np.quantile(POINTS[:, 0], 0.4)) :]
        tracker.track(image)
    image, truth = scene(1.2)
    astray = np.where(cover[:, None], truth + 25.0, truth)
    found = [tracker.track(image, astray) for _ in range(40)]
    assert found[-1].observation.visible[cover].mean() > 0.5
    assert right(found[-1], truth)


@pytest.mark.parametrize("light", [0.6, 1.4])
def test_a_change_of_light_is_another_picture_of_the_same_background(light: float) -> None:
    page = cv2.resize(texture(3), (640, 480))
    brighter = np.clip(page * light, 0, 255).astype(np.uint8)
    surface = np.array([[250.0, 200.0], [390.0, 200.0], [390.0, 300.0], [250.0, 300.0]])
    assert same_background(page, brighter, surface)
    assert not same_background(page, cv2.resize(texture(4), (640, 480)), surface)


def test_a_surface_of_a_few_points_is_not_lost_with_one_of_them() -> None:
    places = np.array([[60.0 + 50 * (k % 4), 60.0 + 55 * (k // 4)] for k in range(12)])
    image, spots = np.full_like(IMAGE, 120), texture(seed=4)
    for x, y in places.astype(int):
        image[y - 12 : y + 13, x - 12 : x + 13] = spots[y - 12 : y + 13, x - 12 : x + 13]
    tracker, covered = GuardedTracker(image, places), image.copy()
    covered[45:75, 40:80] = 120
    for _ in range(20):
        now = tracker.track(covered)
        assert now.observation.visible.sum() >= 10
