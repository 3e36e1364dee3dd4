"""Fixtures of the command line's tests."""

from pathlib import Path

import numpy as np
import pytest

from reconstruction.camera import Camera
from tests.app import forked
from tests.app.command_line import Command, in_process, still, turning, write_video
from tests.app.exported import FRAMES as EXPORTED
from tests.synthetic_run import Run, write_run
from tests.tracking.scene import SIZE


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """The empty folder that commands run in."""
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture(autouse=True)
def quick_to_start(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Our processes are forked, except where they are what is tested."""
    if "recording" not in str(request.path.relative_to(Path(__file__).parent)):
        monkeypatch.setattr("app.processes.child.started", forked.started)


@pytest.fixture
def modeshape(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, here: Path) -> Command:
    """`modeshape ARGUMENTS…`, as if typed in that folder."""
    assert Path.cwd() == here
    return in_process(capfd, monkeypatch)


@pytest.fixture(scope="session")
def videos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of short videos: a sheet that turns, one that does not move, one frame, nothing but black."""
    folder = tmp_path_factory.mktemp("videos")
    write_video(folder / "turning.mp4", turning(40))
    write_video(folder / "still.mp4", still(70))
    write_video(folder / "one.mp4", still(1))
    write_video(folder / "black.mp4", [np.zeros((*SIZE[::-1], 3), np.uint8)] * 20)
    (folder / "text.mp4").write_text("This is not a video.\n" * 50)
    (folder / "empty.mp4").touch()
    return folder


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A recording."""
    return write_run(tmp_path_factory.mktemp("export") / "sheet.rrd", frames=EXPORTED)


@pytest.fixture(scope="session")
def orthographic(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """One of an orthographic camera."""
    camera = Camera(np.inf, np.array([80.0, 60.0]))
    return write_run(tmp_path_factory.mktemp("export") / "far.rrd", frames=EXPORTED, camera=camera)


@pytest.fixture(scope="session")
def bootstrapping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One that ended before there was a shape."""
    return write_run(tmp_path_factory.mktemp("export") / "early.rrd", frames=3, first_shape=9).path
