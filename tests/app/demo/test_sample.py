"""The sample: what it shows is where the truth says, the sheet does not stretch, and it is made only once."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from app import demo
from app.demo import camera, store
from app.demo.motion import HEIGHT_MM, WIDTH_MM, Surface
from app.terminal.errors import UsageError

FRAMES = st.integers(0, demo.FRAMES - 1)
BENT = (0, 33, 75, 130, 190, 217, 240, 262, 299)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> demo.Sample:
    """The sample."""
    return demo.sample(tmp_path_factory.mktemp("cache"))


def edges() -> NDArray[np.int64]:
    faces = demo.grid()[1]
    return np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])), axis=0)


def rigid_error(flat: NDArray[np.float64], shape: NDArray[np.float64]) -> float:
    """Share of the shape (n, 3) that the best rotation of the flat sheet (n, 3) leaves."""
    shape = shape - shape.mean(axis=0)
    U, _, Vt = np.linalg.svd(flat.T @ shape)
    turned = flat @ (U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt)
    return float(np.linalg.norm(turned - shape) / np.linalg.norm(shape))


@given(FRAMES)
def test_the_sheet_does_not_stretch(frame: int) -> None:
    xy_mm, _ = demo.grid()
    a, b = edges().T
    flat = np.linalg.norm(xy_mm[a] - xy_mm[b], axis=1)
    shape = demo.true_shape(frame)
    assert np.abs(np.linalg.norm(shape[a] - shape[b], axis=1) / flat - 1).max() < 0.005


def test_first_two_seconds_are_rigid_and_turn_enough() -> None:
    xy_mm, _ = demo.grid()
    flat = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
    normals = []
    for frame in range(demo.RIGID_FRAMES):
        shape = demo.true_shape(frame)
        assert rigid_error(flat, shape) < 1e-9
        normals.append(demo.surface(frame).normals(np.zeros((1, 2)))[0])
    yaw, pitch = np.degrees(np.arctan2(np.array(normals)[:, :2], -np.array(normals)[:, 2:])).T
    for angle in (yaw, pitch):
        assert angle.min() < -14
        assert angle.max() > 14
    assert 5 < np.degrees(np.arccos(-normals[0][2])) < 12


def test_then_it_bends_substantially() -> None:
    xy_mm, _ = demo.grid()
    flat = np.column_stack([xy_mm, np.zeros(len(xy_mm))])
    errors = [rigid_error(flat, demo.true_shape(frame)) for frame in range(0, demo.FRAMES, 2)]
    assert 0.08 < np.mean(errors) < 0.12


def test_it_can_be_tracked_inside_facing_and_slow() -> None:
    xy_mm, _ = demo.grid()
    before = None
    for frame in range(demo.FRAMES):
        shape = demo.true_shape(frame)
        points = demo.project(shape)
        assert points.min() > 5
        assert (points < np.array(demo.SIZE) - 5).all()
        sight = shape / np.linalg.norm(shape, axis=1, keepdims=True)
        facing = -(sight * demo.surface(frame).normals(xy_mm)).sum(axis=1)
        assert np.degrees(np.arccos(facing.min())) < 61
        if before is not None:
            assert np.linalg.norm(points - before, axis=1).max() < 8
        before = points


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


def test_video_has_all_frames_at_true_times_and_clean(made: demo.Sample) -> None:
    video = cv2.VideoCapture(str(made.video))
    for frame in range(demo.FRAMES):
        read, picture = video.read()
        assert read
        assert video.get(cv2.CAP_PROP_POS_MSEC) == pytest.approx(1000 * frame / demo.FPS, abs=1)
        if frame % 50 == 0:
            assert cv2.PSNR(picture, demo.render(frame)) > 33
    assert not video.read()[0]


def test_truth_has_the_agreed_arrays(made: demo.Sample) -> None:
    with np.load(made.truth) as truth:
        frames, points = truth["gt_frames"], len(truth["uv"])
        assert frames.tolist() == list(range(0, demo.FRAMES, demo.TRUTH_EVERY))
        assert points >= 300
        assert truth["W_px"].shape == (len(frames), 2, points)
        assert truth["S_gt"].shape == (len(frames), 3, points)
        image = truth["K"] @ truth["S_gt"]
        np.testing.assert_allclose(image[:, :2] / image[:, 2:], truth["W_px"], atol=1e-9)
        assert truth["K"][0, 0] != demo.SIZE[0]
        assert truth["uv"].min() == 0
        assert truth["uv"].max() == 1
        assert truth["faces"].max() == points - 1
        assert truth["shading"].shape == (len(frames), points)
        assert truth["shading"].min() > 0.2
        np.testing.assert_array_equal(truth["occluder"][54], demo.occluder(216))
    texture = cv2.imread(str(made.texture))
    assert texture.shape[1] / texture.shape[0] == pytest.approx(WIDTH_MM / HEIGHT_MM)


def test_region_lies_on_the_sheet(made: demo.Sample) -> None:
    x, y, w, h = made.roi
    corners = demo.project(demo.true_shape(0))
    assert (corners.min(axis=0) < (x, y)).all()
    assert (corners.max(axis=0) > (x + w, y + h)).all()
    assert w * h > 0.75 * np.prod(np.ptp(corners, axis=0))


def test_made_once(made: demo.Sample) -> None:
    calls: list[tuple[int, int]] = []
    again = demo.sample(made.video.parents[1], progress=lambda *done: calls.append(done))
    assert again == made
    assert calls == []
    assert sorted(path.name for path in made.video.parent.iterdir()) == [
        "sheet.mp4",
        "sheet.png",
        "sheet_gt.npz",
    ]


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples of a few frames."""
    monkeypatch.setattr(store, "FRAMES", 5)


@pytest.mark.usefixtures("quick")
def test_made_again_when_a_file_is_missing(tmp_path: Path) -> None:
    calls: list[tuple[int, int]] = []
    first = demo.sample(tmp_path, progress=lambda *done: calls.append(done))
    assert calls == [(frame + 1, 5) for frame in range(5)]
    first.truth.unlink()
    assert demo.sample(tmp_path) == first
    assert first.truth.is_file()


@pytest.mark.usefixtures("quick")
def test_interrupted_run_leaves_nothing_that_passes_for_a_sample(tmp_path: Path) -> None:
    def interrupt(done: int, _total: int) -> None:
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        demo.sample(tmp_path, progress=interrupt)
    assert not list(tmp_path.rglob("sheet*"))
    assert demo.sample(tmp_path).video.is_file()


@pytest.mark.usefixtures("quick")
def test_other_version_is_another_sample(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = demo.sample(tmp_path)
    monkeypatch.setattr(cv2, "__version__", "0.0")
    assert demo.sample(tmp_path).video != first.video


@pytest.mark.usefixtures("quick")
def test_default_folder_is_the_users_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert demo.sample().video.parents[1] == tmp_path / "modeshape"


def test_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(UsageError, match=r"cannot write .*file.*XDG_CACHE_HOME"):
        demo.sample(tmp_path / "file")
