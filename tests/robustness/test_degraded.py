"""What the pipeline stands: cuts, blur, light, noise, compression, dropped frames."""

from pathlib import Path

import pytest

from app.demo import Sample, sample
from app.demo.camera import SIZE
from tests.robustness.degraded import (
    FRAMES,
    Change,
    Result,
    blurred,
    changed,
    compressed,
    flickering,
    noisy,
    run,
    thinned,
    write,
)

KINECT_ROI = (195, 95, 325, 265)


@pytest.mark.slow
def test_after_a_cut_the_sheet_is_found_again(shared_data: Path, tmp_path: Path) -> None:
    result = run(shared_data / "kinect_paper.mp4", shared_data / "kinect_paper_gt.npz", KINECT_ROI, tmp_path)
    assert result.words["losses"] == result.words["recoveries"]
    assert result.visible[135].mean() > 0.9
    assert result.words["frames_lost"] <= 15  # type: ignore[operator]
    assert result.visible[150].mean() >= 0.5
    assert result.error(range(136, 191)) <= 0.03


@pytest.fixture(scope="module")
def made() -> Sample:
    return sample()


@pytest.fixture(scope="module")
def clean(made: Sample, tmp_path_factory: pytest.TempPathFactory) -> Result:
    return run(made.video, made.truth, made.roi, tmp_path_factory.mktemp("clean"), f":{FRAMES}")


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        pytest.param((flickering(0.4), blurred(8)), id="light and blur", marks=pytest.mark.slow),
        pytest.param((noisy(10), compressed(30)), id="noise and jpeg", marks=pytest.mark.slow),
    ],
)
def test_bad_pictures_cost_little(made: Sample, tmp_path: Path, changes: tuple[Change, ...]) -> None:
    pictures = changed(made.video, *changes, frames=FRAMES)
    result = run(write(tmp_path / "bad.avi", pictures, SIZE), made.truth, made.roi, tmp_path, f":{FRAMES}")
    assert result.words["losses"] == 0
    assert result.e3d.mean() <= 0.016


@pytest.mark.slow
def test_half_of_the_frames_is_enough(made: Sample, clean: Result, tmp_path: Path) -> None:
    video, truth = thinned(made.video, made.truth, tmp_path, 0.5)
    result = run(video, truth, made.roi, tmp_path)
    assert result.words["losses"] == 0
    assert result.e3d.mean() <= 1.5 * clean.e3d.mean()
