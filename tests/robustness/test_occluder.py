"""What the pipeline stands: something that lies over it for a second."""

from pathlib import Path

import pytest

from app.demo import Sample, sample
from app.demo.camera import SIZE
from tests.robustness.degraded import (
    OCCLUDED,
    Result,
    changed,
    occluded,
    run,
    write,
)


@pytest.fixture(scope="module")
def made() -> Sample:
    return sample()


@pytest.fixture(scope="module")
def clean(made: Sample, tmp_path_factory: pytest.TempPathFactory) -> Result:
    return run(made.video, made.truth, made.roi, tmp_path_factory.mktemp("clean"))


@pytest.mark.slow
@pytest.mark.parametrize(("where", "most"), [("disc", 0.041), ("side", 0.119)])  # as found, and a tenth
def test_an_occluder_costs_little(made: Sample, clean: Result, tmp_path: Path, where: str, most: float) -> None:
    # Over one side, the hidden part has a free end and bends out of sight: what it does is not to be known.
    pictures = changed(made.video, occluded(made.truth, where))
    result = run(write(tmp_path / "occluded.avi", pictures, SIZE), made.truth, made.roi, tmp_path)
    assert result.words["losses"] == 0
    assert result.visible[OCCLUDED.start + 1 : OCCLUDED.stop].mean() < 0.7
    after = range(OCCLUDED.stop, 300)
    assert result.visible[OCCLUDED.stop + 10].mean() >= 0.9
    assert result.error(OCCLUDED) <= most
    assert result.error(after) <= 1.3 * clean.error(after)
