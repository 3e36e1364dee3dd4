"""The command works in any folder, whatever Python files that holds."""

import json
import os
from pathlib import Path

import cv2
import pytest

from app.bench.end_to_end import run_apart
from tests.app import command_line
from tests.app.command_line import in_own_process, still, turning, write_video
from tests.synthetic_run import verify

OPTIONS = ("--rest-shape", "plane", "--bootstrap-frames", "8", "--points", "60", "--modes", "5", "--focal", "320")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with packages and modules of the names of ours, and of NumPy's; imported, they end the program."""
    (tmp_path / "app").mkdir()
    for name in ("app/__init__.py", "tracking.py", "reconstruction.py", "numpy.py"):
        (tmp_path / name).write_text("raise SystemExit(f'{__name__} was imported from the current folder')\n")
    return tmp_path


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sheet that turns."""
    return write_video(tmp_path_factory.mktemp("videos") / "turning.mp4", turning(30))


def test_run_retexture_and_batch_beside_foreign_modules(folder: Path, video: Path) -> None:
    done = in_own_process(folder, "run", video, *OPTIONS, "--out", "run.rrd", "--json")
    assert done.code == 0, done.err
    verify(folder / "run.rrd")
    cv2.imwrite(str(folder / "picture.png"), next(iter(still(1))))
    done = in_own_process(folder, "retexture", "run.rrd", "--texture", "picture.png", "--out", "out.mp4")
    assert done.code == 0, done.err
    done = in_own_process(folder, "batch", video, "--out", "batch", "--json", f"--options={' '.join(OPTIONS)}")
    assert done.code == 0, done.err
    assert json.loads(done.out)["failed"] == 0


@pytest.mark.slow
def test_benchmarks_beside_foreign_modules(folder: Path, video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    assert run_apart(video, None, (0, 0, 320, 240), 60, 10)["points"] > 0


def test_python_path_with_the_current_folder(folder: Path, video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = os.pathsep.join([".", command_line.ENVIRONMENT["PYTHONPATH"]])
    monkeypatch.setitem(command_line.ENVIRONMENT, "PYTHONPATH", path)
    done = in_own_process(folder, "run", video, *OPTIONS, "--frames", ":10")
    assert done.code == 0, done.err
