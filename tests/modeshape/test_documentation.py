"""The examples in docstrings and in examples/ run."""

import doctest
import runpy
import shutil
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import modeshape

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def folder(paper: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, a copy of the one that the examples expect."""
    shutil.copytree(paper, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("name", ["modeshape.video", "modeshape.tracks", "modeshape.recording"])
@pytest.mark.usefixtures("folder")
def test_examples_in_docstrings(name: str) -> None:
    failed, tried = doctest.testmod(import_module(name))
    assert tried > 0
    assert failed == 0


def run(name: str, *arguments: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    monkeypatch.setattr(sys, "argv", [name, *arguments])
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    return capsys.readouterr().out


def test_video_to_mesh(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    region = ("135", "123", "341", "243")
    out = run("video_to_mesh.py", "paper.mp4", *region, monkeypatch=monkeypatch, capsys=capsys)
    assert len(out.splitlines()) == len(list((folder / "meshes").glob("*.ply"))) == 7


def test_own_tracks(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    out = run("own_tracks.py", "tracks.npy", monkeypatch=monkeypatch, capsys=capsys)
    assert np.load(folder / "shapes.npy").shape == (70, 120, 3)
    assert "70 shapes" in out


@pytest.mark.usefixtures("folder")
def test_recording_to_numpy(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    out = run("recording_to_numpy.py", "recordings/paper.rrd", monkeypatch=monkeypatch, capsys=capsys)
    assert len(out.splitlines()) == 70


def test_every_example_is_run() -> None:
    assert {path.name for path in EXAMPLES.iterdir()} == {"video_to_mesh.py", "own_tracks.py", "recording_to_numpy.py"}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: modeshape.Reconstruction((640, 480), focal_px=-1), "focal_px -1"),
        (lambda: modeshape.Reconstruction((640, 480)).update(np.ones((2, 30))), r"has the shape \(2, 30\)"),
        (lambda: [(r := modeshape.Reconstruction((640, 480))).update(np.ones((3, 2))), r.finish()], "no rest shape"),
        (lambda: modeshape.Settings(metric="other"), "metric 'other' is unknown: choose from auto, euclidean"),
        (lambda: modeshape.Settings(deformation="other"), "deformation 'other' is unknown"),
        (lambda: modeshape.reconstruct("paper.mp4", region=(0, 0, 99)), "give x, y, width, height"),
    ],
)
def test_mistakes_of_callers_are_value_errors(call: Callable[[], object], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        call()
