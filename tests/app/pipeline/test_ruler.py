"""A known length makes millimetres."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.pipeline.quality.ruler import longest_side, ruler
from app.playback.playback import Playback
from app.terminal.errors import UsageError
from tests.app.command_line import Command

GRID = np.stack(np.meshgrid(np.arange(0, 101, 10.0), np.arange(0, 51, 10.0)), axis=-1).reshape(-1, 2)


def bent(radius: float) -> np.ndarray:
    """The grid (3, p) on a cylinder, which keeps lengths."""
    x, y = GRID.T
    return np.stack([radius * np.sin(x / radius), y, -radius * np.cos(x / radius)])


def test_along_a_sheet_as_a_tape_lies() -> None:
    tape = ruler(200.0, np.array([[0.0, 20.0], [100.0, 20.0]]), GRID)
    for radius in (1e6, 60.0, 40.0):
        tape.add(bent(radius))
    assert tape.mm_per_px(along=True) == pytest.approx(2.0, rel=0.01)
    assert tape.mm_per_px(along=False) == pytest.approx(200 / (2 * 60 * np.sin(100 / 120)), rel=0.01)


def test_the_longest_side_and_a_little_beyond_the_points() -> None:
    assert sorted(longest_side(GRID)[:, 0].tolist()) == pytest.approx([0, 100])
    assert longest_side(GRID)[:, 1].tolist() == pytest.approx([25, 25])
    tape = ruler(110.0, np.array([[-5.0, 20.0], [105.0, 20.0]]), GRID)
    tape.add(bent(1e9))
    assert tape.mm_per_px(along=True) == pytest.approx(1.0, rel=1e-3)
    with pytest.raises(UsageError, match="150 20 is 50 px off the surface"):
        ruler(110.0, np.array([[0.0, 20.0], [150.0, 20.0]]), GRID)


def test_everything_is_millimetres(modeshape: Command, videos: Path) -> None:
    arguments = (
        "run",
        videos / "turning.mp4",
        "--frames",
        ":30",
        "--image",
        "none",
        "--json",
        "--no-search",
        "--uncertainty",
    )
    plain = json.loads(modeshape(*arguments, "--out", "px.rrd", "--shapes-out", "px.npz").out)
    scaled = json.loads(
        modeshape(
            *arguments, "--out", "mm.rrd", "--shapes-out", "mm.npz", "--size-mm", 50, "--between", "90,120,230,120"
        ).out
    )
    unit = scaled["mm_per_px"]
    assert "mm_per_px" not in plain
    assert unit == pytest.approx(50 / 140, rel=0.1)
    with np.load("px.npz") as px, np.load("mm.npz") as mm:
        for name in ("S", "Lambda", "rest", "sigma"):
            np.testing.assert_allclose(mm[name], unit * px[name], rtol=1e-6, atol=1e-9)
        S = mm["R"] @ (mm["rest"] + mm["Phi"] @ mm["Lambda"] @ mm["Upsilon"])
        origin = np.column_stack([mm["t"], np.full(len(S), mm["K"][0, 0])]) / mm["s"][:, None]
        np.testing.assert_allclose(mm["S"], S + origin[:, :, None], rtol=1e-6, atol=1e-9)
        played, before = Playback.load(Path("mm.rrd")), Playback.load(Path("px.rrd"))
        np.testing.assert_allclose(played.shapes(), mm["S"], rtol=1e-5, atol=1e-3)
    assert played.unit == "millimetres"
    first, same = played.estimate(20), before.estimate(20)
    assert first is not None
    assert same is not None
    np.testing.assert_allclose(first.projection_px, same.projection_px, atol=1e-6)
