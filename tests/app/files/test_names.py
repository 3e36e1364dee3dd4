"""Names that do not exist yet."""

from pathlib import Path

import pytest

from app.files.names import beside, free_name


@pytest.mark.parametrize(
    ("source", "name"),
    [
        ("paper.mp4", "paper"),
        ("/a/b/paper.mov", "paper"),
        ("0", "camera0"),
        ("frames/img%04d.png", "img04d"),
        ("http://host/clip.mp4?x=1", "clip"),
    ],
)
def test_recordings_are_named_after_their_source(source: str, name: str, here: Path) -> None:
    assert free_name(here, source) == here / f"{name}.rrd"
    (here / f"{name}.rrd").touch()
    (here / f"{name}-2.rrd").touch()
    assert free_name(here, source) == here / f"{name}-3.rrd"


def test_parts_of_an_earlier_run_are_kept_or_replaced(here: Path) -> None:
    first, second = here / "run.rrd", here / "run-part2.rrd"
    assert beside(first, "part2", overwrite=False) == second
    second.touch()
    assert beside(first, "part2", overwrite=False) == here / "run-part2-2.rrd"
    assert beside(first, "part2", overwrite=True) == second
