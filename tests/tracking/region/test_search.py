"""The surface found in small videos that are composed, and in real ones."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tests.tracking.scene import texture
from tracking import TrackingError
from tracking.features import detect_corners
from tracking.region.search import LEAST_FRAMES, MOST_FRAMES, Search, search
from tracking.video import Frame, Video

Image = NDArray[np.uint8]
WHOLE = np.full((240, 320), 255, np.uint8)


def scene(*boxes: tuple[int, int, int, int, float], frames: int = 60, wall: Image | None = None) -> Iterator[Frame]:
    """Textured boxes x, y, width, height before a textured wall, each swinging along x by so many px."""
    wall = texture(1) if wall is None else wall
    for k in range(frames):
        image = wall.copy()
        for seed, (x, y, w, h, swing) in enumerate(boxes):
            patch = np.float32([[1, 0, x + swing * np.sin(0.05 * k)], [0, 1, y]])
            size = (image.shape[1], image.shape[0])
            inside = cv2.warpAffine(np.full((h, w), 255, np.uint8), patch, size) > 127
            image[inside] = cv2.warpAffine(texture(10 + seed)[:h, :w], patch, size)[inside]
        yield Frame(k, k / 30, image)


BORDER_PX = 4  # what is nearer to something else is left out


def overlap(region: Image, x: int, y: int, w: int, h: int) -> float:
    """Intersection over union of a region and a rectangle, but for its border."""
    truth = np.zeros_like(region)
    truth[y + BORDER_PX : y + h - BORDER_PX, x + BORDER_PX : x + w - BORDER_PX] = 255
    return float(((truth > 0) & (region > 0)).sum() / ((truth > 0) | (region > 0)).sum())


def test_a_box_before_a_wall_is_found() -> None:
    found = search(scene((90, 60, 130, 110, 25.0)), WHOLE)
    assert found.surface is not None
    assert found.narrowed
    assert not found.others
    assert overlap(found.region, 90, 60, 130, 110) > 0.75
    assert found.frames < 40  # it has moved enough by then


def test_a_box_before_a_wall_is_found_by_a_camera_that_is_held_by_hand() -> None:
    frames = []
    for frame in scene((90, 60, 130, 110, 25.0)):
        k = frame.index
        held = np.float32([[1, 0, 14 * np.sin(0.3 * k)], [0, 1, 9 * np.sin(0.21 * k)]])
        image = cv2.warpAffine(frame.image, held, (320, 240), borderMode=cv2.BORDER_REFLECT)
        frames.append(replace(frame, image=np.asarray(image, np.uint8)))
    found = search(frames, WHOLE)
    assert found.narrowed
    assert overlap(found.region, 90, 60, 130, 110) > 0.7


def test_a_flat_sheet_that_fills_the_picture_is_the_surface_at_once() -> None:
    frames = []
    for k in range(60):
        held = np.float32([[1, 0, 2.0 * k], [0, 1, 0.5 * k]])
        image = cv2.warpAffine(texture(1), held, (320, 240), borderMode=cv2.BORDER_REFLECT)
        frames.append(Frame(k, k / 30, np.asarray(image, np.uint8)))
    found = search(frames, WHOLE)
    assert found.surface is not None
    assert (found.region > 0).mean() > 0.8
    assert found.frames < 15


def test_where_it_is_in_the_last_frame_is_known_too() -> None:
    frames = list(scene((90, 60, 130, 110, 25.0), frames=25))
    looked = Search(frames[0].image, WHOLE)
    assert all(looked.add(frame.image) for frame in frames[1:])
    region, x = looked.region_now(), 90 + round(25.0 * np.sin(0.05 * 24))
    assert overlap(region, x, 60, 130, 110) > 0.75


def test_where_nothing_moves_no_place_is_told() -> None:
    looked = Search(texture(1), WHOLE)
    assert looked.add(texture(1))
    with pytest.raises(TrackingError, match="nothing moves"):
        looked.region_now()


def test_what_is_fainter_than_the_wall_is_found_too() -> None:
    """A face before bookshelves."""
    frames = []
    for frame in scene((90, 60, 130, 110, 25.0)):
        still = (frame.image == texture(1)).all(axis=2)
        faint = (120 + (frame.image.astype(int) - 128) // 5).astype(np.uint8)
        frames.append(replace(frame, image=np.where(still[:, :, None], frame.image, faint)))
    found = search(frames, WHOLE)
    assert found.narrowed
    assert overlap(found.region, 90, 60, 130, 110) > 0.4


def test_within_a_loose_region_too() -> None:
    region = np.zeros_like(WHOLE)
    region[30:210, 40:280] = 255
    found = search(scene((90, 60, 130, 110, 25.0)), region)
    assert overlap(found.region, 90, 60, 130, 110) > 0.75


def test_a_tight_region_stays_as_it_is() -> None:
    region = np.zeros_like(WHOLE)
    region[65:165, 95:215] = 255
    found = search(scene((90, 60, 130, 110, 25.0)), region)
    assert found.surface is not None
    assert not found.narrowed
    assert found.region is region


def test_of_two_the_larger_that_moves_more_is_taken_and_the_other_named() -> None:
    found = search(scene((20, 60, 130, 120, 20.0), (210, 70, 90, 100, -12.0)), WHOLE)
    assert overlap(found.region, 20, 60, 130, 120) > 0.7
    assert len(found.others) == 1
    x, y, w, h = found.others[0].box
    assert 195 < x < 225
    assert 55 < y < 85
    assert 70 < w < 130
    assert 80 < h < 125


def test_what_rushes_in_and_is_covered_at_once_tells_nothing() -> None:
    """It moves enough within four frames, but one or two motions hardly tell what moves together."""
    rushing = list(scene((20, 40, 130, 110, 200.0), frames=LEAST_FRAMES - 2))
    then = scene((90, 60, 130, 110, 25.0), wall=texture(2))
    found = search([*rushing, *(replace(frame, index=len(rushing) + frame.index) for frame in then)], WHOLE)
    assert found.first.index == len(rushing)
    assert found.frames > LEAST_FRAMES
    assert overlap(found.region, 90, 60, 130, 110) > 0.75


def test_a_still_scene_is_taken_whole() -> None:
    found = search(scene(frames=150), WHOLE)
    assert found.surface is None
    assert found.region is WHOLE
    assert found.frames == MOST_FRAMES


def test_black_frames_are_waited_for() -> None:
    black = [Frame(k, k / 30, np.zeros((240, 320, 3), np.uint8)) for k in range(7)]
    begun = (Frame(frame.index + 7, frame.time_s, frame.image) for frame in scene((90, 60, 130, 110, 25.0)))
    found = search([*black, *begun], WHOLE)
    assert found.first.index == 7
    assert overlap(found.region, 90, 60, 130, 110) > 0.75


def test_a_fade_is_waited_for() -> None:
    first, *later = scene((90, 60, 130, 110, 25.0))
    faint = [Frame(k, k / 30, (first.image * (k / 20)).astype(np.uint8)) for k in range(20)]
    found = search([*faint, *(Frame(frame.index + 20, frame.time_s, frame.image) for frame in later)], WHOLE)
    assert 8 <= found.first.index <= 20
    assert overlap(found.region, 90, 60, 130, 110) > 0.7


def test_what_comes_after_a_title_card_is_taken() -> None:
    card = [Frame(k, k / 30, texture(7)) for k in range(12)]
    begun = (Frame(frame.index + 12, frame.time_s, frame.image) for frame in scene((90, 60, 130, 110, 25.0)))
    found = search([*card, *begun], WHOLE)
    assert found.first.index == 12
    assert overlap(found.region, 90, 60, 130, 110) > 0.75


def test_what_comes_before_a_cut_is_taken_if_it_moves() -> None:
    after = [Frame(60 + k, 2 + k / 30, texture(7)) for k in range(12)]
    found = search([*scene((90, 60, 130, 110, 12.0)), *after], WHOLE)
    assert found.first.index == 0
    assert overlap(found.region, 90, 60, 130, 110) > 0.7


def test_of_nothing_but_cuts_the_picture_with_most_motion_is_taken() -> None:
    swinging = list(scene((90, 60, 130, 110, 25.0), frames=6))
    cuts = [Frame(k, k / 30, texture(30 + k)) for k in range(4)]
    frames = [replace(frame, index=k) for k, frame in enumerate([*cuts[:2], *swinging, *cuts[2:]])]
    assert search(frames, WHOLE).first.index == 2


def test_endless_cuts_are_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tracking.region.search.MOST_WAITED", 10)
    taken = []
    search((taken.append(k) or Frame(k, k / 30, texture(k)) for k in range(20)), WHOLE)  # type: ignore[func-returns-value]
    assert len(taken) == 10


def test_of_a_drawn_region_what_is_in_its_middle_is_taken() -> None:
    region = np.zeros_like(WHOLE)
    region[40:200, 70:250] = 255
    frames = list(scene((90, 60, 130, 110, 20.0), frames=60))
    for frame in frames:  # the wall goes farther
        wall = np.roll(texture(1), 2 * frame.index, axis=0)
        still = (frame.image == texture(1)).all(axis=2)
        frame.image[still] = wall[still]
    found = search(frames, region)
    assert overlap(found.region, 90, 60, 130, 110) > 0.6


def test_only_black_frames_are_an_error() -> None:
    with pytest.raises(TrackingError, match="corners"):
        search([Frame(k, k / 30, np.zeros((240, 320, 3), np.uint8)) for k in range(5)], WHOLE)


def test_the_same_twice() -> None:
    first, second = (search(scene((90, 60, 130, 110, 25.0)), WHOLE) for _ in range(2))
    np.testing.assert_array_equal(first.region, second.region)


@pytest.mark.parametrize(
    ("name", "surface"),
    [
        # outlines of what is held or shown, in the first frame, px
        ("kinect_paper", [(165, 75), (570, 105), (560, 395), (145, 360)]),
        ("box", [(296, 100), (400, 5), (595, 72), (590, 100), (540, 242), (310, 170)]),
        ("talking_face", [(110, 110), (140, 25), (235, 10), (285, 110), (250, 220), (190, 240), (150, 220), (115, 165)]),
        ("face_turning", [(130, 90), (260, 10), (420, 60), (480, 200), (420, 512), (50, 512)]),
    ],
)
def test_points_in_real_videos_are_on_the_surface(shared_data: Path, name: str, surface: list[tuple[int, int]]) -> None:
    with Video(str(shared_data / f"{name}.mp4")) as video:
        found = search(video, np.full(video.size[::-1], 255, np.uint8))
    points = detect_corners(cv2.cvtColor(found.first.image, cv2.COLOR_BGR2GRAY), found.region)
    outline = np.array(surface, np.float32)
    inside = np.array([cv2.pointPolygonTest(outline, (float(x), float(y)), True) > -12 for x, y in points])
    assert inside.mean() > 0.95  # a hand may move as what it holds
