"""Scenes follow from kind and seed; what they show is what their truth says."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.demo.camera import K, project
from app.files.track_file import load_tracks, load_truth
from app.synthetic.catalog import HELD_SEEDS, KINDS
from app.synthetic.places import grid
from app.synthetic.scene import scene
from app.synthetic.tracks import SEVERE, USUAL, tracks
from app.synthetic.video import Renderer, region, write_video
from tracking.video import Video

CLOTHS = ("cloth", "towel", "blanket")  # take time to hang


@pytest.mark.parametrize("kind", [pytest.param(kind, marks=pytest.mark.slow if kind in CLOTHS else ()) for kind in KINDS])
def test_it_is_in_view_and_moves_smoothly(kind: str) -> None:
    one = scene(kind, 5)
    places = grid(9, 7)
    points = np.stack([one.points(places, frame) for frame in range(one.frames)])
    assert points[..., 2].min() > 1
    pixels = np.stack([project(p) for p in points])
    assert (pixels > 5).all()
    assert (pixels < (635, 475)).all()
    assert np.linalg.norm(np.diff(pixels, axis=0), axis=2).max() < (60 if kind == "flag" else 25)


def test_seeds_and_kinds_are_held_back() -> None:
    assert not scene("box", 1).held_back
    assert scene("box", HELD_SEEDS).held_back
    assert scene("cone", 1).held_back


def test_a_late_solid_is_almost_still_at_first() -> None:
    early, late = (scene(kind, 2) for kind in ("box", "box-late"))
    for one, least, most in ((early, 10, 90), (late, 0, 6)):
        R = one.path.pose(0.0)[0].T @ one.path.pose(0.4)[0]
        assert least <= np.rad2deg(np.arccos((np.trace(R) - 1) / 2)) <= most


def test_tracks_are_the_truth_seen_by_the_camera(tmp_path: Path) -> None:
    made = tracks(scene("head", 1, frames=40))
    with (tmp_path / "head.npz").open("wb") as file:
        made.save(file)
    read = load_tracks(tmp_path / "head.npz")
    assert read.S_gt is not None
    image = K @ read.S_gt
    off = (read.W - image[:, :2] / image[:, 2:]).transpose(0, 2, 1)[read.visible]
    assert off.std() == pytest.approx(USUAL.noise_px, rel=0.05)
    assert 0.5 < read.visible.mean() < 1  # a head hides its far cheek
    again = tracks(scene("head", 1, frames=40))
    np.testing.assert_array_equal(again.W, made.W)


def test_damage_is_what_it_says() -> None:
    made = tracks(scene("rolling", 1, frames=40), SEVERE)
    assert made.S_gt is not None
    image = K @ made.S_gt
    off = np.linalg.norm(made.W - image[:, :2] / image[:, 2:], axis=1)[made.visible]
    assert made.visible.mean() == pytest.approx(0.6, abs=0.02)
    assert (off > 5).mean() == pytest.approx(SEVERE.outliers, abs=0.02)
    assert np.median(off) == pytest.approx(1.18 * SEVERE.noise_px, rel=0.15)


def test_pictures_show_the_thing_where_the_truth_has_it() -> None:
    one = scene("waving-7", 1)
    renderer = Renderer(one)
    pictures = [cv2.cvtColor(renderer.render(frame), cv2.COLOR_BGR2GRAY) for frame in (30, 31)]
    places = grid(9, 7) * 0.9
    first, second = (project(one.points(places, frame)).astype(np.float32) for frame in (30, 31))
    found, status, _ = cv2.calcOpticalFlowPyrLK(pictures[0], pictures[1], first, first.copy(), winSize=(15, 15))
    off = np.linalg.norm(found - second, axis=1)[status[:, 0] > 0]
    assert len(off) > 55
    assert np.median(off) < 0.1


def test_a_video_comes_with_its_truth(tmp_path: Path) -> None:
    one = scene("box", 1, frames=9)
    filmed = write_video(one, tmp_path)
    with Video(str(filmed.video)) as video:
        assert sum(1 for _ in video) == 9
    truth = load_truth(filmed.truth)
    assert truth.frames.tolist() == [0, 4, 8]
    x, y, w, h = filmed.roi
    assert filmed.roi == region(one)
    left, top = truth.W_px[0].min(axis=1)
    right, bottom = truth.W_px[0].max(axis=1)
    assert left < x < x + w < right
    assert top < y < y + h < bottom


def test_a_far_side_is_no_truth_of_the_points_before_it(tmp_path: Path) -> None:
    truth = load_truth(write_video(scene("drum", 1, frames=5), tmp_path).truth)
    across, _, deep = np.ptp(truth.S[0], axis=1)
    assert deep < 0.6 * across
