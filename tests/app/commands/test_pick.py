"""A frame with a grid, and regions by their corners."""

import json
from pathlib import Path

import cv2
import numpy as np

from tests.app.command_line import Command

AROUND = (80, 60, 250, 70, 240, 190, 70, 180)
QUICK = ("--frames", ":6", "--image", "none", "--json", "--no-final-pass", "--points", 60)


def test_a_frame_with_a_grid_of_pixels(modeshape: Command, videos: Path) -> None:
    done = modeshape("frame", videos / "turning.mp4", "--number", 3, "--grid", 40, "--out", "grid.png", "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["width"] == 320
    assert modeshape("frame", videos / "turning.mp4", "--number", 3, "--grid", 0, "--out", "plain.png").code == 0
    grid, plain = (cv2.imread(name).astype(int) for name in ("grid.png", "plain.png"))
    assert grid.shape == plain.shape == (240, 320, 3)
    changed = np.abs(grid - plain).max(axis=2) > 0
    assert changed[:, [0, 40, 280]].mean() > 0.9
    assert changed[[0, 40, 200]].mean() > 0.9
    assert changed[45:75, 85:115].mean() < 0.1
    again = modeshape("frame", videos / "turning.mp4", "--out", "grid.png")
    assert again.code == 2
    assert "grid.png exists" in again.err


def test_points_lie_within_the_corners(modeshape: Command, videos: Path) -> None:
    polygon = np.reshape(AROUND, (-1, 2)).astype(np.float32)
    for name in ("--corners", "--polygon"):
        tracks = f"{name[2:]}.npz"
        done = modeshape("run", videos / "turning.mp4", *QUICK, name, *AROUND, "--tracks-out", tracks)
        assert done.code == 0, done.err
        with np.load(tracks) as saved:
            points = saved["W"][0].T.astype(np.float32)
        assert min(cv2.pointPolygonTest(polygon, (float(x), float(y)), True) for x, y in points) >= -1.0


def test_corners_that_are_none(modeshape: Command, videos: Path) -> None:
    for wrong, told in (
        (("--corners", 80, 60, 240, 190, 250, 70, 70, 180), "going round"),
        (("--polygon", 400, 300, 500, 300, 500, 400), "no area in the picture of 320x240"),
        (("--polygon", *AROUND, "--corners", *AROUND), "give one of them"),
    ):
        done = modeshape("run", videos / "turning.mp4", *QUICK, *wrong)
        assert done.code == 2
        assert told in done.err


def test_a_mistake_in_the_options_is_told_before_anything_is_drawn(modeshape: Command, videos: Path) -> None:
    done = modeshape("pick", videos / "still.mp4", "--options=--nope")
    assert (done.code, "--nope" in done.err) == (2, True)


def test_a_picture_does_not_replace_its_source(modeshape: Command, here: Path) -> None:
    cv2.imwrite("page.png", np.zeros((48, 64, 3), np.uint8))
    before = Path("page.png").read_bytes()
    done = modeshape("frame", "page.png", "--out", "page.png", "--overwrite")
    assert (done.code, "page.png" in done.err) == (2, True)
    assert (here / "page.png").read_bytes() == before
