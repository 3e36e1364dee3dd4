"""What a recording says about its run."""

from pathlib import Path

import numpy as np
import pytest

from app.playback.facts import Facts, facts, finite, phase_ranges, statistics, worst_frames
from app.playback.measures import reviewed
from app.playback.playback import Playback
from tests.app.exported import FRAMES
from tests.synthetic_run import Run


def facts_of(path: Path) -> Facts:
    (one,) = reviewed([Playback.load(path)])
    return facts(one.playback, one.measured)


def test_phases_follow_each_other(run: Run) -> None:
    assert phase_ranges(Playback.load(run.path)) == [("bootstrap", 0, 1), ("tracking", 2, FRAMES - 1)]


def test_before_there_is_a_shape_what_it_would_tell_is_not_known(bootstrapping: Path) -> None:
    told = facts_of(bootstrapping)
    assert (told.frames, told.frames_with_shape, told.reprojection_px, told.worst_frames) == (3, 0, None, [])
    assert [phase["phase"] for phase in told.phases] == ["bootstrap"]
    assert told.rest_shape_note is None


def test_json_has_no_number_that_is_not_finite() -> None:
    assert finite({"focal": np.inf, "e3d": np.nan, "modes": 4}) == {"focal": None, "e3d": None, "modes": 4}


def test_statistics() -> None:
    assert statistics(np.arange(101.0)) == pytest.approx({"mean": 50, "p95": 95, "max": 100})


def test_worst_frames_are_of_different_incidents() -> None:
    frames, rms_px = np.arange(100, 140), np.ones(40)
    rms_px[[3, 4, 20]] = 5, 6, 4
    rms_px[10] = np.nan
    worst = worst_frames(frames, frames / 30, rms_px)
    assert [row["frame"] for row in worst[:2]] == [104, 120]
    assert worst[0]["rms_px"] == 6
