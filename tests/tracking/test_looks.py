"""What points look like is taken from a frame that shows them clearer than the reference did."""

import cv2
import numpy as np
import pytest

from tests.tracking.scene import SIZE, moved, texture, tilt
from tracking.features import detect_corners
from tracking.flow import Grays
from tracking.guarded import Change, GuardedTracker
from tracking.klt import PointTracker
from tracking.looks import Looks, pictures_of
from tracking.region.mask import region_mask

IMAGE = texture()
POINTS = detect_corners(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY), region_mask(SIZE, (70, 55, 180, 130)), 250)
PLAIN = np.broadcast_to(np.eye(2), (len(POINTS), 2, 2))
EVERY = np.ones(len(POINTS), np.bool_)


def shaken(image: np.ndarray, px: int) -> np.ndarray:
    """Blurred along x."""
    return cv2.blur(image, (px, 1)) if px > 1 else image


def looks(image: np.ndarray) -> Looks:
    return Looks(pictures_of(Grays.of(image)), POINTS)


@pytest.mark.parametrize(("first", "then", "renewed"), [(9, 1, True), (1, 1, False), (1, 9, False)])
def test_only_a_much_clearer_frame_is_the_reference_from_then_on(first: int, then: int, *, renewed: bool) -> None:
    pictures = pictures_of(Grays.of(shaken(IMAGE, then)))
    known = looks(shaken(IMAGE, first))
    assert known.renew(pictures, POINTS, PLAIN, EVERY) is renewed
    assert not known.renew(pictures, POINTS, PLAIN, EVERY)  # now it is no clearer
    score = known.levels[0].align(pictures[0], POINTS, PLAIN, np.arange(len(POINTS)), 0).score
    assert bool(np.median(score) > 0.99) is (renewed or first == then)


def test_a_frame_that_shows_too_few_of_the_points_is_not() -> None:
    seen = EVERY.copy()
    seen[::3] = False
    assert not looks(shaken(IMAGE, 9)).renew(pictures_of(Grays.of(IMAGE)), POINTS, PLAIN, seen)


def test_points_of_a_shaken_first_frame_are_followed_as_they_are_later() -> None:
    tracker = PointTracker(shaken(IMAGE, 27), POINTS)
    renewed = 0
    for frame, k in enumerate(np.linspace(0.0, 1.0, 16)[1:]):
        forward, backward = tilt(k)
        seen = tracker.track(shaken(moved(IMAGE, backward), 27 - 6 * frame))
        renewed += seen.renewed
    off = np.linalg.norm(seen.points_px - forward(POINTS), axis=1)[seen.visible]
    assert 0 < renewed < 4
    assert seen.visible.mean() > 0.92  # 0.88 by the first frame alone
    assert np.percentile(off, 90) < 0.8
    assert seen.alike > 0.9  # 0.38


def test_a_surface_is_found_again_by_the_clearer_frame() -> None:
    tracker = GuardedTracker(shaken(IMAGE, 15), POINTS)
    for k in (0.0, 0.02, 0.04):
        tracker.track(moved(IMAGE, tilt(k)[1]))
    assert tracker.track(texture(seed=9)).change is Change.LOST
    forward, backward = tilt(0.6)
    image = np.roll(moved(IMAGE, backward), 50, axis=1)
    found = tracker.track(image)
    assert found.change is Change.RECOVERED
    seen = found.observation.visible
    assert seen.mean() > 0.6
    assert np.median(np.linalg.norm(found.observation.points_px - forward(POINTS) - (50, 0), axis=1)[seen]) < 0.5
