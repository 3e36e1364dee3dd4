"""Every command that reads recordings, given what is none, or given no room: one line says so, and nothing is left."""

import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest
import rerun as rr

from tests.app.command_line import Command, Outcome
from tests.synthetic_run import write_run

FRAMES = 120
COMMANDS = [
    "review IT",
    "review IT --csv out.csv --plot out.png",
    "review good.rrd IT",
    "retexture IT --texture red.png --out out.mp4",
    *(f"export IT --format {kind}" for kind in ("glb", "obj", "ply", "csv", "npz", "mp4", "webm")),
    "modes IT --out out.png",
]
NO_RECORDINGS = {
    "missing.rrd": "there is no recording missing.rrd",
    "text.rrd": "text.rrd is not a recording",
    "film.rrd": "film.rrd is not a recording",
    "foreign.rrd": "foreign.rrd is a recording of another application (somebody_elses)",
    "stub.rrd": "stub.rrd contains no",
}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("long") / "good.rrd", frames=FRAMES).path


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("short") / "short.rrd", frames=20).path


@pytest.fixture
def files(here: Path, recording: Path) -> Path:
    """The folder the commands run in."""
    whole = recording.read_bytes()
    (here / "good.rrd").write_bytes(whole)
    (here / "cut.rrd").write_bytes(whole[: int(0.7 * len(whole))])
    (here / "stub.rrd").write_bytes(whole[:700])
    (here / "text.rrd").write_text("dear diary")
    (here / "film.rrd").write_bytes(b"\0\0\0\x18ftypmp42" + bytes(999))
    stream = rr.RecordingStream("somebody_elses")
    stream.save(here / "foreign.rrd")
    stream.log("points", rr.Points3D([[1, 2, 3]]))
    stream.flush()
    stream.disconnect()
    cv2.imwrite(str(here / "red.png"), np.full((20, 30, 3), (20, 20, 240), np.uint8))
    (here / "text.png").write_text("dear diary")
    return here


def tree(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_size for path in folder.iterdir()}


def check(outcome: Outcome, words: str) -> None:
    assert outcome.code == 2
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1
    assert words in outcome.err
    assert outcome.out == ""


@pytest.mark.parametrize(
    ("command", "name"),
    [
        pytest.param(command, name, marks=() if command == COMMANDS[0] or name == "text.rrd" else pytest.mark.slow)
        for command in COMMANDS
        for name in NO_RECORDINGS
    ],
)
def test_what_is_no_recording(modeshape: Command, files: Path, command: str, name: str) -> None:
    before = tree(files)
    check(modeshape(*command.replace("IT", name).split()), NO_RECORDINGS[name])
    assert tree(files) == before


@pytest.mark.parametrize("command", COMMANDS)
def test_one_that_is_cut_off_is_used_as_far_as_it_goes(modeshape: Command, files: Path, command: str) -> None:
    outcome = modeshape(*command.replace("IT", "cut.rrd").split())
    assert outcome.code == 0
    assert "cut.rrd is cut off: " in outcome.err
    made = [path for path in files.iterdir() if path.name.startswith(("out", "cut.", "cut-", "cut_"))]
    assert len(made) >= 1 + ("--out" in command or "--csv" in command or "--format" in command)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("retexture good.rrd --texture text.png --out out.mp4", "text.png is not a picture that can be read"),
        ("retexture good.rrd --texture none.png --out out.mp4", "no texture none.png"),
        ("retexture good.rrd --texture red.png --out out.avi", "videos are written as .mp4 or .webm"),
        ("retexture good.rrd --texture red.png --out out", "videos are written as .mp4 or .webm"),
        ("export good.rrd --format fbx", "fbx"),
        ("export good.rrd --out out.gltf", "no format"),
        ("export good.rrd --format mp4 --out out.webm", "let it end in .mp4"),
        ("review good.rrd --plot out.bmp", ".bmp is no format for figures"),
        ("modes good.rrd --out out.gif", "is no PNG"),
    ],
)
def test_textures_and_formats(modeshape: Command, files: Path, command: str, words: str) -> None:
    before = tree(files)
    check(modeshape(*command.split()), words)
    assert tree(files) == before


@pytest.mark.parametrize("ending", ["mp4", "webm"])
@pytest.mark.parametrize("command", ["export good.rrd --out out", "retexture good.rrd --texture red.png --out out"])
def test_a_codec_that_is_not_there(
    modeshape: Command, files: Path, command: str, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.files.video_out.CODECS", {".mp4": "XXXX", ".webm": "XXXX"})
    before = tree(files)
    check(modeshape(*f"{command}.{ending}".split()), f"cannot write out.{ending}: this PyAV has no XXXX encoder")
    assert tree(files) == before


@contextmanager
def little_room(size: int) -> Iterator[None]:
    """No file can be made larger, as if the disk were full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.parametrize(
    "command",
    [
        "review good.rrd --csv out.csv",
        "review good.rrd --plot out.png",
        "retexture good.rrd --texture red.png --out out.mp4",
        "retexture good.rrd --texture red.png --out out.webm",
        *(f"export good.rrd --format {kind}" for kind in ("glb", "csv", "npz", "mp4", "webm")),
        "modes good.rrd --out out.png",
    ],
)
def test_a_disk_with_room_for_a_part_only(modeshape: Command, files: Path, short: Path, command: str) -> None:
    shutil.copy(short, files / "good.rrd")
    before = tree(files)
    with little_room(2_000):
        outcome = modeshape(*command.split())
    check(outcome, "cannot write ")
    assert tree(files) == before
