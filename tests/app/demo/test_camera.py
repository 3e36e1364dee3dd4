"""The sample's pictures show the sheet where the truth says."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app import demo
from app.demo import camera, store
from app.demo.motion import HEIGHT_MM, WIDTH_MM, Surface

FRAMES = st.integers(0, demo.FRAMES - 1)
BENT = (0, 33, 75, 130, 190, 217, 240, 262, 299)


@given(FRAMES, st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_line_of_sight_comes_back_to_the_point_it_started_from(frame: int, u: float, v: float) -> None:
    sheet = demo.surface(frame)
    xy_mm = np.array([(u * WIDTH_MM, v * HEIGHT_MM)])
    x, y = demo.project(sheet.points(xy_mm))[0]
    seen = demo.sheet_at(sheet, np.array([x], np.float32), np.array([y], np.float32))
    # 0.05 mm is 0.06 px
    assert np.hypot(seen[0] - xy_mm[0, 0], seen[1] - xy_mm[0, 1]).item() < 0.05


@pytest.mark.parametrize("frame", BENT)
def test_printed_dots_appear_where_the_truth_projects_them(frame: int, monkeypatch: pytest.MonkeyPatch) -> None:
    scale = camera._PAGE_PX_PER_MM
    page = np.full((round(HEIGHT_MM * scale), round(WIDTH_MM * scale), 4), 255, np.uint8)
    dots = np.stack(np.meshgrid(np.arange(-4, 5) * 30.0, np.arange(-3, 4) * 28.0), axis=-1).reshape(-1, 2)
    for x, y in dots:
        centre = np.rint(((x + WIDTH_MM / 2) * scale - 0.5, (y + HEIGHT_MM / 2) * scale - 0.5) * np.array(16))
        spot = (int(centre[0]), int(centre[1]))
        cv2.circle(page, spot, 9 * 16, (0, 0, 0, 255), -1, cv2.LINE_AA, shift=4)
    monkeypatch.setattr(camera, "_page", lambda: page)
    picture = demo.render(frame, hand=False)[..., 1].astype(float)
    for x, y in demo.project(demo.surface(frame).points(dots)):
        left, top = round(x) - 8, round(y) - 8
        patch = picture[top : top + 17, left : left + 17]
        ink = np.clip(0.8 * np.percentile(patch, 90) - patch, 0, None)
        rows, columns = np.mgrid[top : top + 17, left : left + 17]
        centroid = np.array([(ink * columns).sum(), (ink * rows).sum()]) / ink.sum()
        assert np.hypot(*(centroid - (x, y))) < 0.3


def test_where_the_sheet_hides_itself_the_nearer_part_is_seen() -> None:
    arc = np.arange(-200.0, 200.5, 0.5)
    slope = np.radians(115) * np.sin(2 * np.pi * arc / 200)
    curve = np.cumsum(np.column_stack([np.cos(slope), np.sin(slope)]) * 0.5, axis=0)
    sheet = Surface(np.eye(3), np.array([0.0, 0, 500]), 0.0, arc, curve - curve[-1] / 2, slope)
    points = sheet.points(np.column_stack([arc, np.zeros_like(arc)]))
    image = demo.project(points)[:, 0]
    silhouettes = image[np.flatnonzero(np.diff(np.sign(np.diff(image)))) + 1]
    assert len(silhouettes) >= 2
    columns = np.arange(np.ceil(image.min()) + 2, image.max() - 2, dtype=np.float32)
    seen, _ = demo.sheet_at(sheet, columns, np.array([240], np.float32))
    hidden = 0
    for column, place in zip(columns, seen[0], strict=True):
        if np.abs(silhouettes - column).min() < 2:
            continue
        crossed = np.flatnonzero(np.diff(np.sign(image - column)))
        nearest = crossed[points[crossed, 2].argmin()]
        assert abs(place - arc[nearest]) < 1.0
        hidden += len(crossed) > 1
    assert hidden > 10


@pytest.mark.parametrize("frame", [0, 100, 217])
def test_the_same_frame_is_the_same_picture(frame: int) -> None:
    first = demo.render(frame)
    for cached in (camera._ground, camera._page, camera._grain, camera._vignette):
        cached.cache_clear()
    assert first.dtype == np.uint8
    assert first.shape == (480, 640, 3)
    np.testing.assert_array_equal(first, demo.render(frame))


def test_the_hand_passes_once_and_never_covers_more_than_a_third() -> None:
    covered = []
    for frame in range(demo.FRAMES):
        mask = demo.occluder(frame)
        sheet = np.zeros(mask.shape, np.uint8)
        outline = cv2.convexHull(demo.project(demo.true_shape(frame)).astype(np.float32))
        cv2.fillConvexPoly(sheet, np.rint(outline).astype(np.int32), 1)
        covered.append((mask & (sheet > 0)).sum() / sheet.sum())
    seen = np.flatnonzero(covered)
    assert np.array_equal(seen, np.arange(seen[0], seen[-1] + 1))
    assert seen[0] >= demo.FRAMES // 2
    assert 25 <= len(seen) <= 45
    assert 0.24 < max(covered) < 0.35


def test_without_hand_only_its_surroundings_change() -> None:
    with_hand, without = demo.render(217), demo.render(217, hand=False)
    changed = (with_hand != without).any(axis=2)
    assert changed[demo.occluder(217)].mean() > 0.95
    np.testing.assert_array_equal(demo.render(100), demo.render(100, hand=False))


def test_every_patch_of_the_sheet_has_corners() -> None:
    grey = cv2.cvtColor(demo.render(0), cv2.COLOR_BGR2GRAY)
    x, y, w, h = store._roi()
    found = cv2.goodFeaturesToTrack(grey[y : y + h, x : x + w], 1200, 0.01, 5)
    cells = (found[:, 0] / (w, h) * (6, 4)).astype(int)
    per_cell = np.bincount(cells[:, 1] * 6 + cells[:, 0], minlength=24)
    assert len(found) > 800
    assert per_cell.min() >= 8
