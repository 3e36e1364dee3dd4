"""Large pictures are followed in a smaller copy, and what comes of it is in their own pixels."""

import cv2
import numpy as np
import pytest

from app.pipeline.stages.messages import Footage
from app.pipeline.stages.tracking import first_points
from app.pipeline.stages.working_copy import WorkingCopy
from tests.tracking.scene import SIZE, texture
from tracking.guarded import GuardedTracker
from tracking.video import Frame


@pytest.mark.parametrize(
    ("size", "factor"), [((640, 480), 1), ((1920, 1080), 1), ((2560, 1440), 2), ((2880, 2160), 3), ((2160, 3840), 4)]
)
def test_only_large_pictures_have_one(size: tuple[int, int], factor: int) -> None:
    assert WorkingCopy(size).factor == factor
    assert WorkingCopy(size, full=True).factor == 1


@pytest.mark.parametrize(
    ("size", "wide", "kept"),
    [
        ((1920, 1080), 0, (1920, 1080)),
        ((2560, 1440), 0, (1280, 720)),
        ((3840, 2160), 0, (1920, 1080)),
        ((2160, 3840), 640, (1080, 1920)),  # the recording makes them smaller still
        ((3840, 2160), 2560, (3840, 2160)),
    ],
)
def test_large_pictures_are_kept_smaller_unless_more_is_asked_for(
    size: tuple[int, int], wide: int, kept: tuple[int, int]
) -> None:
    copy = WorkingCopy(size, wide=wide)
    frame = copy.keep(Frame(3, 0.1, np.zeros((size[1], size[0], 3), np.uint8)))
    assert frame.image.shape[1::-1] == copy.kept == kept
    assert (frame.index, frame.time_s) == (3, 0.1)
    assert copy.picture(frame.image).shape[1::-1] == copy.size
    assert WorkingCopy(size, full=True).kept == size


def test_points_there_and_back() -> None:
    copy = WorkingCopy((2880, 2160))
    points = np.random.default_rng(0).uniform(0, 2000, (9, 2))
    assert np.allclose(copy.in_picture(copy.points(points)), points)
    assert np.allclose(copy.points(np.array([[1.0, 1.0]])), 0)  # the middle of the first three pixels


def test_points_are_as_sure_as_in_a_small_picture() -> None:
    factor, shift = 9, 18  # px of the large picture
    size = SIZE[0] * factor, SIZE[1] * factor
    page = cv2.resize(texture(), size, interpolation=cv2.INTER_CUBIC)
    copy = WorkingCopy(size)
    region = np.full(size[::-1], 255, np.uint8)
    points = first_points(Footage("video.mp4", points=60), copy.picture(page), region, copy)
    tracker = GuardedTracker(copy.picture(page), copy.points(points))
    moved = copy.guarded(tracker.track(copy.picture(np.roll(page, shift, axis=1)))).observation
    off = moved.points_px[moved.visible] - points[moved.visible] - (shift, 0)
    assert moved.visible.mean() > 0.8
    assert np.median(np.linalg.norm(off, axis=1)) < 0.1 * copy.factor
