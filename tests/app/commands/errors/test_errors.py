"""What can go wrong: one line that names the thing, exit code 2, nothing overwritten, nothing left behind."""

import zipfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.app.command_line import Command, Outcome, in_own_process
from tests.synthetic_run import verify

POINTS = 40


def tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def check(outcome: Outcome, *words: str) -> None:
    assert outcome.code == 2, outcome
    assert outcome.out == ""
    lines = outcome.err.splitlines()
    assert len(lines) == 1, outcome.err
    assert lines[0].startswith("error: ")
    assert "Traceback" not in outcome.err
    for word in words:
        assert word in lines[0]


RUNS = [
    ("nothing.mp4", ["no video file", "nothing.mp4"]),
    ("{videos}", ["is a folder"]),
    ("{videos}/text.mp4", ["text.mp4", "cannot be decoded"]),
    ("{videos}/empty.mp4", ["empty.mp4", "cannot be decoded"]),
    ("img%04d.png", ["img%04d.png"]),
    ("{videos}/one.mp4", ["one.mp4", "only one frame"]),
    ("{videos}/still.mp4 --frames 3:4", ["still.mp4", "only one frame", "--frames"]),
    ("{videos}/black.mp4", ["corners found", "region with texture"]),
    (
        "{videos}/still.mp4 --rest-shape rigid --no-search",
        ["turned", "° in 60 frames, about 10° are needed", "--rest-shape plane"],
    ),
    (
        "{videos}/still.mp4 --rest-shape rigid --bootstrap-frames 12 --no-search",
        ["turned", "° in 12 frames, about 10° are needed"],
    ),
    ("{videos}/still.mp4 --rest-shape rigid --frames 0:5 --no-search", ["cannot recover a rest shape", "too few frames"]),
    ("{videos}/still.mp4 --roi 300 200 100 100", ["300 200 100 100", "320x240"]),
    ("{videos}/still.mp4 --roi 10 10 0 50", ["10 10 0 50"]),
    ("{videos}/still.mp4 --roi 1 2", ["--roi 1 2 has 2 numbers", "X Y WIDTH HEIGHT"]),
    ("{videos}/still.mp4 --roi 1,2,3", ["--roi 1 2 3 has three numbers", "X Y WIDTH HEIGHT", "for instance --roi 195"]),
    ("{videos}/still.mp4 --roi x", ["--roi x has no numbers"]),
    ("{videos}/still.mp4 --rio 1 2 3 4", ["no --rio", "did you mean --roi?"]),
    ("{videos}/still.mp4 195 95 325 265", ["did you mean --roi 195 95 325 265?"]),
    ("{videos}/still.mp4 --roi=300,200,100,100", ["300 200 100 100", "320x240"]),
    ("{videos}/still.mp4 --roi -3 200 100 100", ["-3 200 100 100", "320x240"]),
    ("{videos}/still.mp4 --points 5", ["--points 5", "20 and more"]),
    ("{videos}/still.mp4 --mask small.png", ["small.png has 100x100 px, the video 320x240"]),
    ("{videos}/still.mp4 --mask black.png", ["mask is empty", "black.png"]),
    ("{videos}/still.mp4 --mask no.png", ["no mask file no.png"]),
    ("{videos}/still.mp4 --mask text.obj", ["text.obj is not a picture"]),
    ("{videos}/still.mp4 --modes 800 --no-search", ["--modes 800 does not fit", "points"]),
    ("{videos}/still.mp4 --modes 20 --points 20 --no-search", ["--modes 20 does not fit 20 points"]),
    ("{videos}/still.mp4 --modes 0", ["--modes 0"]),
    ("{videos}/still.mp4 --points 2", ["--points 2"]),
    ("{videos}/still.mp4 --window 0", ["--window 0"]),
    ("{videos}/still.mp4 --bootstrap-frames 1", ["--bootstrap-frames 1"]),
    ("{videos}/still.mp4 --energy paper", ["--energy paper", "--camera orthographic"]),
    ("{videos}/still.mp4 --energy other", ["--energy", "'other'", "anchored"]),
    ("{videos}/still.mp4 --priors other=1", ["--priors other=1", "no prior other", "rest, smoothness, rotation"]),
    ("{videos}/still.mp4 --priors rest", ["--priors rest", "NAME=WEIGHT"]),
    ("{videos}/still.mp4 --priors rest=much", ["--priors rest=much", "NAME=WEIGHT"]),
    ("{videos}/still.mp4 --priors rest=-1", ["-1", "prior rest", "0 (to leave it out) or more"]),
    ("{videos}/still.mp4 --priors scale=nan", ["nan", "prior scale"]),
    ("{videos}/still.mp4 --metric other", ["--metric", "'other'", "manhattan"]),
    ("{videos}/still.mp4 --deformation other", ["--deformation", "'other'", "inextensible"]),
    ("{videos}/still.mp4 --camera other", ["--camera", "'other'", "orthographic"]),
    ("{videos}/still.mp4 --focal 0", ["--focal 0"]),
    ("{videos}/still.mp4 --focal -5", ["--focal"]),
    ("{videos}/still.mp4 --focal nan", ["--focal nan"]),
    ("{videos}/still.mp4 --focal wide", ["--focal", "wide"]),
    ("{videos}/still.mp4 --duration inf", ["--duration inf"]),
    ("{videos}/still.mp4 --frames 5", ["--frames 5", "A:B"]),
    ("{videos}/still.mp4 --frames 20:10", ["--frames 20:10"]),
    ("{videos}/still.mp4 --frames a:b", ["--frames a:b"]),
    ("{videos}/still.mp4 --frames 200:300", ["still.mp4 ends at frame 70"]),
    ("{videos}/still.mp4 --rest-shape no.obj", ["no mesh file no.obj"]),
    ("{videos}/still.mp4 --rest-shape other", ["other"]),
    ("{videos}/still.mp4 --rest-shape text.obj", ["text.obj"]),
    ("{videos}/still.mp4 --rest-shape far.obj", ["far.obj does not fit", "corners lie inside"]),
    ("{videos}/still.mp4 --ground-truth no.npz", ["no file no.npz"]),
    ("{videos}/still.mp4 --ground-truth tracks.npz", ["tracks.npz", "no array S_gt"]),
    ("{videos}/still.mp4 --out taken.rrd", ["taken.rrd exists", "--overwrite"]),
    ("{videos}/still.mp4 --tracks-out tracks.npz", ["tracks.npz exists", "--overwrite"]),
    ("{videos}/still.mp4 --shapes-out tracks.npz", ["tracks.npz exists", "--overwrite"]),
    ("{videos}/still.mp4 --out taken.rrd/x.rrd", ["cannot write taken.rrd/x.rrd"]),
    ("{videos}/still.mp4 --tracks-out taken.rrd/x.npz", ["cannot write taken.rrd/x.npz"]),
    ("{videos}/still.mp4 --shapes-out /proc/x.npz", ["cannot write /proc/x.npz"]),
    ("{videos}/still.mp4 --image other", ["--image", "'other'"]),
    ("{videos}/still.mp4 --connect 127.0.0.1:1 --no-search", ["127.0.0.1:1", "start one"]),
    ("{videos}/still.mp4 --nonsense", ["--nonsense"]),
    ("", ["Missing from modeshape run", "Video file"]),
]

EVALUATIONS = [
    ("no.npz", ["no file no.npz"]),
    ("text.obj", ["text.obj is not an .npz file"]),
    ("{videos}/still.mp4", ["still.mp4 is not an .npz file"]),
    ("keys.npz", ["keys.npz has no array W", "only X"]),
    ("flat.npz", ["flat.npz", "W has the shape (12, 1, 40)"]),
    ("words.npz", ["words.npz", "numbers are needed"]),
    ("objects.npz", ["objects.npz"]),
    ("visible.npz", ["visible.npz", "visible has the shape (12, 39)"]),
    ("nan.npz", ["nan.npz", "not finite", "frame 3, point 4"]),
    ("truth.npz", ["truth.npz", "S_gt has the shape (2, 3, 39)"]),
    ("late.npz", ["late.npz", "gt_frames goes to 50"]),
    ("camera.npz", ["camera.npz", "K is no camera matrix"]),
    ("blind.npz --rest-shape plane", ["4 points"]),
    ("one.npz", ["one.npz shows no point in 2 frames"]),
    ("line.npz", ["line.npz", "the points lie on one line"]),
    ("huge.npz", ["huge.npz", "values beyond 1e+100"]),
    ("many.npz", ["many.npz has 100,001 points, at most 100,000 are possible: take one of 2"]),
    ("notes.npz", ["notes.npz holds W, which is no array"]),
    ("bomb.npz", ["bomb.npz unpacks to 5 GB; at most 4"]),
    ("still.npz --rest-shape rigid", ["turned 0.0° in 12 frames, about 10° are needed"]),
    ("tracks.npz --rest-shape first-truth", ["tracks.npz has no true shapes S_gt"]),
    ("tracks.npz --rest-shape far.obj", ["far.obj does not fit", "4 vertices", "40 points"]),
    ("tracks.npz --rest-shape no.obj", ["no mesh file no.obj"]),
    ("tracks.npz --modes 40", ["--modes 40 does not fit 40 points"]),
    ("tracks.npz --modes 400", ["--modes 400 does not fit 40 points"]),
    ("tracks.npz --camera perspective", ["tracks.npz has no K", "--focal"]),
    ("tracks.npz --energy paper --focal 300", ["--energy paper"]),
    ("tracks.npz --missing 1", ["--missing 1"]),
    ("tracks.npz --noise -1", ["--noise"]),
    ("tracks.npz --noise nan", ["--noise nan"]),
    ("tracks.npz --seed -1", ["--seed"]),
    ("tracks.npz --shapes-out keys.npz", ["keys.npz exists", "--overwrite"]),
    ("tracks.npz --shapes-out /proc/x.npz", ["cannot write /proc/x.npz"]),
    ("tracks.npz --metric other", ["--metric", "'other'"]),
    ("", ["Missing from modeshape evaluate", "Tracks"]),
]


@pytest.fixture
def files(here: Path) -> Path:
    """The folder the command runs in, with every file that is wrong in some way."""
    rng = np.random.default_rng(0)
    W = 50 * rng.normal(size=(12, 2, POINTS)) + 200
    hole, blind = W.copy(), np.ones((12, POINTS), bool)
    hole[3, 0, 4] = np.nan
    blind[:] = False
    np.savez(here / "tracks.npz", W=W)
    np.savez(here / "keys.npz", X=W)
    np.savez(here / "flat.npz", W=W[:, :1])
    np.savez(here / "words.npz", W=np.full((3, 2, 4), "a"))
    np.savez(here / "objects.npz", W=np.full((3, 2, 4), None), allow_pickle=True)
    np.savez(here / "visible.npz", W=W, visible=np.ones((12, POINTS - 1), bool))
    np.savez(here / "nan.npz", W=hole, visible=np.ones((12, POINTS), bool))
    np.savez(here / "truth.npz", W=W, S_gt=np.zeros((2, 3, POINTS - 1)), gt_frames=[0, 1])
    np.savez(here / "late.npz", W=W, S_gt=rng.normal(size=(2, 3, POINTS)), gt_frames=[0, 50])
    np.savez(here / "camera.npz", W=W, K=np.zeros((3, 3)))
    np.savez(here / "blind.npz", W=W, visible=blind)
    np.savez(here / "still.npz", W=np.broadcast_to(W[:1], W.shape))
    np.savez(here / "one.npz", W=W[:1])
    line = np.linspace(0, 300, POINTS) * np.linspace(1, 1.2, 12)[:, None]
    np.savez(here / "line.npz", W=np.stack([line, line / 2], axis=1) + 0.1 * rng.normal(size=W.shape))
    np.savez(here / "huge.npz", W=1e300 * W)
    np.savez(here / "many.npz", W=rng.normal(size=(2, 2, 100_001)))
    with zipfile.ZipFile(here / "notes.npz", "w") as archive:
        archive.writestr("W.npy", b"not an array")
    with zipfile.ZipFile(here / "bomb.npz", "w") as archive:
        archive.writestr("W.npy", b"")
        archive.infolist()[0].file_size = 5 * 2**30
    cv2.imwrite(str(here / "small.png"), np.full((100, 100), 255, np.uint8))
    cv2.imwrite(str(here / "black.png"), np.zeros((240, 320), np.uint8))
    (here / "text.obj").write_text("not a mesh")
    (here / "far.obj").write_text("v 9000 0 0\nv 9001 0 0\nv 9000 1 0\nv 9001 1 1\nf 1 2 3\nf 2 4 3\n")
    (here / "taken.rrd").write_text("somebody's work")
    return here


def with_ids(table: list[tuple[str, list[str]]]) -> list[object]:
    return [pytest.param(a.split(), words, id=a.replace("{videos}/", "") or "nothing") for a, words in table]


@pytest.mark.parametrize(("arguments", "words"), with_ids(RUNS))
def test_run(modeshape: Command, files: Path, videos: Path, arguments: list[str], words: list[str]) -> None:
    before = tree(files), tree(videos)
    check(modeshape("run", *(a.replace("{videos}", str(videos)) for a in arguments)), *words)
    assert (tree(files), tree(videos)) == before


@pytest.mark.parametrize(("arguments", "words"), with_ids(EVALUATIONS))
def test_evaluate(modeshape: Command, files: Path, videos: Path, arguments: list[str], words: list[str]) -> None:
    before = tree(files)
    check(modeshape("evaluate", *(a.replace("{videos}", str(videos)) for a in arguments)), *words)
    assert tree(files) == before


@pytest.mark.parametrize("arguments", [["dance"], ["--nonsense"]], ids=str)
def test_no_such_command(modeshape: Command, arguments: list[str]) -> None:
    check(modeshape(*arguments), "modeshape")


OWN_PROCESS: list[tuple[str, Callable[[Path], Path]]] = [
    ("cannot be decoded", lambda videos: videos / "text.mp4"),
    ("corners found", lambda videos: videos / "black.mp4"),
]


@pytest.mark.parametrize(("words", "source"), OWN_PROCESS, ids=["text", "black"])
def test_no_library_talks_into_it(videos: Path, tmp_path: Path, words: str, source: Callable[[Path], Path]) -> None:
    check(in_own_process(tmp_path, "run", source(videos)), words)
    assert list(tmp_path.iterdir()) == []


def test_frames_without_a_point_warn_nobody(files: Path) -> None:
    check(in_own_process(files, "evaluate", "blind.npz", "--rest-shape", "plane"), "4 points")


def test_a_still_scene_is_a_flat_sheet_and_auto_says_so(modeshape: Command, videos: Path) -> None:
    outcome = modeshape("run", videos / "still.mp4", "--image", "none", "--no-revise", "--out", "still.rrd")
    assert outcome.code == 0
    assert "flat sheet facing the camera" in outcome.err
    assert "no rigid shape: the object turned" in outcome.err
    assert "10° are needed" in outcome.err
    verify(Path("still.rrd"))


def test_overwrite_is_asked_for(modeshape: Command, videos: Path, files: Path) -> None:
    arguments = ("run", videos / "turning.mp4", "--frames", ":6", "--image", "none", "--out", "taken.rrd")
    check(modeshape(*arguments), "taken.rrd exists")
    assert (files / "taken.rrd").read_text() == "somebody's work"
    assert modeshape(*arguments, "--overwrite").code == 0
    verify(files / "taken.rrd")
