"""Whole runs over degraded copies of the sample; of the printed sheet, all that there are."""

from pathlib import Path

import pytest

from app.demo import sample
from app.footage.case import write
from app.footage.catalog import CASES
from app.footage.clip import Clip
from tests.robustness.degraded import Result, run

pytestmark = pytest.mark.slow

FRAMES = 100
KINECT_ROI = (195, 95, 325, 265)


def outcome(clip: Clip, name: str, folder: Path) -> Result:
    copy = write(clip, CASES[name], folder)
    return run(Path(copy.source), copy.truth, copy.roi, folder)


@pytest.mark.parametrize(
    ("name", "losses"),
    [
        ("light in rolling bands", 0),
        ("background moving, region loose", 0),
        ("background moving, region found", 0),
        ("a title card first", 0),
        ("leaves the picture, all", 2),
        ("watermark over 30 %", 0),
    ],
)
def test_the_sample_holds(tmp_path: Path, name: str, losses: int) -> None:
    made = sample()
    result = outcome(Clip(made.video, made.truth, made.roi, FRAMES), name, tmp_path)
    assert 100 * result.e3d.mean() <= (CASES[name].wanted or 0)
    assert int(str(result.words["losses"])) <= losses


@pytest.mark.parametrize("name", CASES)
def test_the_printed_sheet_holds(shared_data: Path, tmp_path: Path, name: str) -> None:
    clip = Clip(shared_data / "kinect_paper.mp4", shared_data / "kinect_paper_gt.npz", KINECT_ROI, 113)
    result, wanted = outcome(clip, name, tmp_path), CASES[name].wanted
    if wanted is None:
        assert result.words["verdict"] == "poor"
    else:
        assert 100 * result.e3d.mean() <= wanted
