"""The command works in any folder, whatever Python files that holds."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time
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


@pytest.mark.parametrize("recorded", [True, False])
def test_a_script_that_leaves_its_video_half_way_ends(tmp_path: Path, video: Path, recorded: bool) -> None:
    code = (
        "import sys, modeshape\n"
        "where = {'recording': 'run.rrd'} if sys.argv[2:] else {}\n"
        "frames = modeshape.reconstruct(sys.argv[1], points=60, settings=modeshape.Settings(modes=5), **where)\n"
        "next(frames)\n"
    )
    command = [sys.executable, "-c", code, str(video), *["recorded"] * recorded]
    done = subprocess.run(command, cwd=tmp_path, env=command_line.ENVIRONMENT, capture_output=True, text=True, timeout=120)
    assert (done.returncode, "Exception" in done.stderr) == (0, False), done.stderr
    if recorded:
        verify(tmp_path / "run.rrd")


@pytest.mark.parametrize("closed", [0, 1])
def test_a_run_without_standard_files(tmp_path: Path, video: Path, closed: int) -> None:
    command = [sys.executable, "-m", "modeshape", "run", str(video), *OPTIONS, "--out", "run.rrd"]
    shell = f"exec {shlex.join(command)} {closed}{'<' if closed == 0 else '>'}&-"
    done = subprocess.run(["bash", "-c", shell], cwd=tmp_path, env=command_line.ENVIRONMENT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(done.stderr) < 5000
    verify(tmp_path / "run.rrd")


@pytest.mark.parametrize("after_s", [0.1, 0.25])
def test_ctrl_c_before_anything_has_begun(tmp_path: Path, video: Path, after_s: float) -> None:
    command = [sys.executable, "-m", "modeshape", "run", str(video), *OPTIONS, "--frames", ":10"]
    with subprocess.Popen(
        command,
        cwd=tmp_path,
        env=command_line.ENVIRONMENT,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # background jobs ignore it
    ) as run:
        time.sleep(after_s)
        run.send_signal(signal.SIGINT)
        _, told = run.communicate(timeout=60)
    assert run.returncode in (130, -signal.SIGINT)  # the latter before Python itself had begun
    assert run.returncode == 130 or after_s < 0.2
    assert "modeshape" not in told.split("Traceback")[-1] or "Traceback" not in told
