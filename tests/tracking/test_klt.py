from pathlib import Path

import cv2
import numpy as np
import pytest

from app.files.track_file import load_truth
from tests.tracking.scene import SIZE, moved, texture, tilt
from tracking.features import detect_corners
from tracking.klt import PointTracker
from tracking.observation import Observation
from tracking.region.mask import region_mask
from tracking.video import Video

STEPS = np.linspace(0.0, 1.0, 16)[1:]
IMAGE = texture()
POINTS = detect_corners(cv2.cvtColor(IMAGE, cv2.COLOR_BGR2GRAY), region_mask(SIZE, (70, 55, 180, 130)), 250)


def scene(k: float) -> tuple[np.ndarray, np.ndarray]:
    """The picture at time k and where the points are in it."""
    forward, backward = tilt(k)
    return moved(IMAGE, backward), forward(POINTS)


def errors(seen: Observation, truth: np.ndarray) -> np.ndarray:
    return np.linalg.norm(seen.points_px - truth, axis=1)[seen.visible]


def hidden(image: np.ndarray, x: int = 0) -> np.ndarray:
    """The picture with a textured hand over its left, up to column x."""
    covered = image.copy()
    covered[:, :x] = texture(seed=5)[:, :x]
    return covered


def test_follows_a_surface_that_turns_and_tilts() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    for k in STEPS:
        image, truth = scene(k)
        seen = tracker.track(image)
    assert seen.visible.mean() > 0.95
    assert np.median(errors(seen, truth)) < 0.1
    assert np.percentile(errors(seen, truth), 98) < 0.5
    assert seen.alike > 0.98


def test_what_comes_to_look_otherwise_is_followed() -> None:
    rng, other = np.random.default_rng(0), texture(seed=5)
    tracker = PointTracker(IMAGE, POINTS)
    for k in np.linspace(0.0, 1.0, 46)[1:]:
        forward, backward = tilt(k)
        image = moved(((1 - 0.7 * k) * IMAGE + 0.7 * k * other).astype(np.uint8), backward)
        seen = tracker.track(np.clip(image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8))
    error = errors(seen, forward(POINTS))
    assert seen.visible.mean() > 0.78  # 0.72 by the reference alone
    assert np.percentile(error, 90) < 1.0
    assert seen.alike < 0.8


def test_points_on_a_contour_do_not_slide_along_it() -> None:
    rng = np.random.default_rng(3)
    bare = IMAGE.copy()
    bare[40:200, 115:165] = (90, 90, 90)
    bare[40:200, 165:215] = (150, 150, 150)  # an edge, no texture beside it

    def noisy(image: np.ndarray) -> np.ndarray:
        return np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)

    on_edge = np.stack([np.full(8, 165.0), np.linspace(75, 165, 8)], axis=1)
    points = np.concatenate([on_edge, POINTS[np.abs(POINTS[:, 0] - 165) > 60]])
    tracker = PointTracker(noisy(bare), points)
    for k in np.linspace(0.0, 1.0, 46)[1:]:
        forward, backward = tilt(k)
        seen = tracker.track(noisy(moved(bare, backward)))
    off = np.linalg.norm(seen.points_px - forward(points), axis=1)[:8]
    assert seen.visible.mean() > 0.9
    assert np.sqrt(np.mean(off**2)) < 1.3, off


def test_an_observation_is_nan_exactly_where_not_visible() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    image, _ = scene(0.1)
    seen = tracker.track(hidden(image, 160))
    assert seen.points_px.shape == (len(POINTS), 2)
    np.testing.assert_array_equal(np.isfinite(seen.points_px).all(axis=1), seen.visible)
    assert 0 < seen.visible.sum() < len(POINTS)
    seen.points_px[:] = 0.0  # the caller's copy
    assert tracker.track(scene(0.15)[0]).visible.any()


def test_hidden_points_are_lost_and_found_again_beside_others_without_a_prediction() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    for k in STEPS[:3]:
        image, truth = scene(k)
        seen = tracker.track(hidden(image, 160))
    assert seen.visible[truth[:, 0] < 150].mean() < 0.05
    assert seen.visible[truth[:, 0] > 175].mean() > 0.9
    for k in STEPS[3:]:  # from neighbour to neighbour
        image, truth = scene(k)
        seen = tracker.track(image)
    assert seen.visible.mean() > 0.95
    assert np.percentile(errors(seen, truth), 98) < 0.5


@pytest.mark.parametrize("miss", [(0.0, 0.0), (3.0, -2.0), (-6.0, 4.0)])
def test_hidden_points_are_taken_up_where_the_model_predicts(miss: tuple[float, float]) -> None:
    tracker = PointTracker(IMAGE, POINTS)
    for k in STEPS[:-3]:  # the surface tilts unseen: only the warped appearance still matches
        image, truth = scene(k)
        seen = tracker.track(hidden(image, 170), truth + miss)
    assert seen.visible.mean() < 0.7
    for k in STEPS[-3:]:
        image, truth = scene(k)
        seen = tracker.track(image, truth + miss)
    assert seen.visible.mean() > 0.95
    assert np.median(errors(seen, truth)) < 0.1
    assert np.percentile(errors(seen, truth), 98) < 0.5


def test_all_points_come_back_after_the_whole_picture_was_gone() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    for _ in range(2):
        assert not tracker.track(np.full_like(IMAGE, 255), POINTS).visible.any()
    image, truth = scene(0.3)
    seen = tracker.track(image, truth + np.array([2.0, -1.5]))
    seen = tracker.track(image, truth)
    assert seen.visible.mean() > 0.9
    assert np.percentile(errors(seen, truth), 98) < 0.5


def test_a_wrong_prediction_takes_up_nothing() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    tracker.track(np.full_like(IMAGE, 255))
    image, truth = scene(0.1)
    seen = tracker.track(image, truth + np.array([40.0, 0.0]))
    assert seen.visible.mean() < 0.05


def test_another_picture_loses_everything() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    tracker.track(scene(0.05)[0])
    assert tracker.track(texture(seed=3)).visible.mean() < 0.1


def test_points_that_leave_the_picture_are_lost() -> None:
    tracker = PointTracker(IMAGE, POINTS)
    for shift in range(0, 140, 10):
        seen = tracker.track(moved(IMAGE, lambda p, s=shift: p + np.array([s, 0])))
    outside = POINTS[:, 0] - 130 < 3
    assert outside.sum() > 20
    assert not seen.visible[outside].any()
    assert seen.visible[POINTS[:, 0] - 130 > 12].mean() > 0.9


def test_drift_is_removed() -> None:
    """Noise pushes pure optical flow about at random; the reference appearance holds the points."""
    rng = np.random.default_rng(0)
    tracker, points, before = PointTracker(IMAGE, POINTS), POINTS.astype(np.float32), IMAGE
    for k in np.tile(STEPS, 4):
        image, truth = scene(0.5 - 0.5 * np.cos(7 * k))
        image = np.clip(image + rng.normal(0, 8, image.shape), 0, 255).astype(np.uint8)
        seen = tracker.track(image)
        gray = [cv2.cvtColor(i, cv2.COLOR_BGR2GRAY) for i in (before, image)]
        points, _, _ = cv2.calcOpticalFlowPyrLK(*gray, points, points.copy(), winSize=(15, 15))
        before = image
    flow = np.median(np.linalg.norm(points - truth, axis=1))
    assert seen.visible.mean() > 0.9
    assert np.median(errors(seen, truth)) < 0.15
    assert np.median(errors(seen, truth)) < 0.5 * flow


@pytest.mark.parametrize("count", [1, 2, 3, 12])
def test_few_points_are_followed_too(count: int) -> None:
    tracker = PointTracker(IMAGE, POINTS[:count])
    for k in STEPS[:4]:
        image, truth = scene(k)
        seen = tracker.track(image)
    assert seen.visible.all()
    assert errors(seen, truth[:count]).max() < 0.5


@pytest.mark.parametrize("kind", ["blur", "darker", "brighter", "noise", "jpeg"])
def test_poor_pictures_are_no_loss(kind: str) -> None:
    def poor(image: np.ndarray) -> np.ndarray:
        if kind == "blur":
            return cv2.blur(image, (9, 1))
        if kind == "noise":
            return np.clip(image + np.random.default_rng(0).normal(0, 10, image.shape), 0, 255).astype(np.uint8)
        if kind == "jpeg":
            return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 30])[1], cv2.IMREAD_COLOR)
        return np.clip(image * {"darker": 0.6, "brighter": 1.4}[kind], 0, 255).astype(np.uint8)

    tracker = PointTracker(IMAGE, POINTS)
    for k in STEPS:
        image, truth = scene(k)
        seen = tracker.track(poor(image), truth)
    assert seen.visible.mean() > 0.85
    assert np.median(errors(seen, truth)) < (0.8 if kind == "blur" else 0.2)


def test_the_paper_is_followed_without_a_model(shared_data: Path) -> None:
    """Against the true pixels: each point is held by barycentric coordinates in the first true frame."""
    from scipy.spatial import Delaunay

    truth = load_truth(shared_data / "kinect_paper_gt.npz")
    with Video(str(shared_data / "kinect_paper.mp4"), 0, 113) as video:
        frames = iter(video)
        first = next(frames).image
        gray = cv2.cvtColor(first, cv2.COLOR_BGR2GRAY)
        tracker = PointTracker(first, detect_corners(gray, region_mask(video.size, (195, 95, 325, 265)), 800))
        seen = {frame.index: tracker.track(frame.image) for frame in frames}
    assert seen[112].visible.mean() > 0.9
    assert len(seen[112].visible) >= 400

    mesh = Delaunay(truth.W_px[0].T)
    start = np.where(seen[8].visible[:, None], seen[8].points_px, -1.0)
    triangle = mesh.find_simplex(start)
    affine = mesh.transform[triangle]
    weight = np.einsum("nij,nj->ni", affine[:, :2], start - affine[:, 2])
    weight = np.concatenate([weight, 1.0 - weight.sum(axis=1, keepdims=True)], axis=1)
    for W, f in zip(truth.W_px[1:], truth.frames[1:], strict=True):
        if f > 112:
            break
        expected = np.einsum("nk,nkd->nd", weight, W.T[mesh.simplices[triangle]])
        both = seen[f].visible & (triangle >= 0)
        error = np.linalg.norm(seen[f].points_px - expected, axis=1)[both]
        assert np.median(error) < 0.6, f
        assert np.percentile(error, 90) < 1.2, f
