"""Names that do not exist yet."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.files.names import beside, free_name
from tests.app.command_line import ENVIRONMENT


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


def test_another_process_does_not_get_a_name_that_is_taken(here: Path) -> None:
    program = "from app.files.names import *; print(free_name(Path.cwd(), 'paper.mp4').name)"
    assert free_name(here, "paper.mp4").name == "paper.rrd"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=here, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stdout == "paper-2.rrd\n"
    assert not list(here.iterdir())


def test_parts_of_an_earlier_run_are_kept_or_replaced(here: Path) -> None:
    first, second = here / "run.rrd", here / "run-part2.rrd"
    assert beside(first, "part2", overwrite=False) == second
    second.touch()
    assert beside(first, "part2", overwrite=False) == here / "run-part2-2.rrd"
    assert beside(first, "part2", overwrite=True) == second
