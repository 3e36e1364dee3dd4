"""The command line on real files: what it prints and writes, and that an interrupt loses nothing."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from tests.app.command_line import ENVIRONMENT, PROGRAM, Command, in_own_process, turning, write_video
from tests.synthetic_run import verify

RUN_KEYS = {
    "verdict", "verdict_reason",
    "frames", "points", "rest_shape", "bootstrap_frames", "visible_share", "reprojection_rms_px", "fps", "stage_ms",
    "recording",
}  # fmt: skip
EVALUATE_KEYS = {
    *("e3d", "e3d_camera", "e3d_static", "e3d_sign_free"),
    *("frames", "points", "modes", "reprojection_rms", "ms_per_frame"),
}
QUICK = ("--points", "120", "--rest-shape", "plane", "--bootstrap-frames", "5", "--modes", "6", "--focal", "320")
STAGES = {"decode", "track", "reconstruct", "record"}


def test_run_writes_what_it_is_asked_for(modeshape: Command, videos: Path) -> None:
    outcome = modeshape(
        "run", videos / "turning.mp4", "--json", "--frames", "2:32", "--points", 300, "--roi", 40, 30, 240, 180,
        "--tracks-out", "out/tracks.npz", "--shapes-out", "out/shapes.npz", "--out", "out/turning.rrd",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words.keys() >= RUN_KEYS
    assert words["stage_ms"].keys() == STAGES
    frames, points = words["frames"], words["points"]
    assert frames == 30
    assert 100 < points <= 300
    assert words["rest_shape"] == "plane"
    assert words["visible_share"] > 0.9
    assert words["reprojection_rms_px"] < 1
    assert words["fps"] > 0
    assert "e3d" not in words
    assert words["recording"] == "out/turning.rrd"
    verify(Path("out/turning.rrd"))
    assert sorted(path.name for path in Path("out").iterdir()) == ["shapes.npz", "tracks.npz", "turning.rrd"]

    with np.load("out/tracks.npz") as tracks:
        W, seen, K = tracks["W"], tracks["visible"], tracks["K"]
    assert W.shape == (frames, 2, points)
    assert seen.shape == (frames, points)
    assert seen.dtype == bool
    assert seen.mean() == pytest.approx(words["visible_share"])
    np.testing.assert_array_equal(np.isfinite(W).all(axis=1), seen)
    with np.load("out/shapes.npz") as shapes:
        modes = shapes["Lambda"].shape[2]
        assert shapes["S"].shape == (frames, 3, points)
        assert shapes["R"].shape == (frames, 3, 3)
        assert shapes["s"].shape == (frames,)
        assert shapes["t"].shape == (frames, 2)
        assert shapes["Lambda"].shape == (frames, 3, modes)
        assert shapes["frames"].tolist() == list(range(2, 32))
        assert shapes["faces"].max() == points - 1
        np.testing.assert_array_equal(shapes["visible"], seen)
        np.testing.assert_allclose(shapes["K"], K)
        image = shapes["K"] @ shapes["S"]
        deformed = shapes["rest"] + shapes["Phi"] @ shapes["Lambda"] @ shapes["Upsilon"]
        turned = shapes["R"] @ deformed
        np.testing.assert_allclose(  # Eq. 3, placed
            shapes["S"] - shapes["S"].mean(axis=2, keepdims=True), turned - turned.mean(axis=2, keepdims=True), atol=1e-6
        )
    residual = np.linalg.norm(image[:, :2] / image[:, 2:] - W, axis=1)[seen]
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(words["reprojection_rms_px"], rel=1e-6)


def test_saved_tracks_can_be_evaluated(modeshape: Command, videos: Path) -> None:
    arguments = ("--frames", ":25", "--tracks-out", "tracks.npz", "--points", 200, "--no-final-pass", "--image", "none")
    run = json.loads(modeshape("run", videos / "turning.mp4", "--json", *arguments).out)
    outcome = modeshape("evaluate", "tracks.npz", "--json", "--shapes-out", "shapes.npz", "--no-final-pass")
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["frames"] == run["frames"]
    assert words["points"] == run["points"]
    assert words["rest_shape"] == run["rest_shape"]
    assert words["reprojection_rms"] == pytest.approx(run["reprojection_rms_px"], rel=0.2)
    assert "e3d" not in words  # there is no truth
    with np.load("shapes.npz") as shapes:
        assert shapes["S"].shape == (25, 3, run["points"])


def test_recordings_are_numbered(modeshape: Command, videos: Path) -> None:
    arguments = ("run", videos / "turning.mp4", "--frames", ":4", "--image", "none", "--json")
    Path("recordings").mkdir()
    Path("recordings", "turning-2.rrd").touch()
    for name in ("turning.rrd", "turning-3.rrd"):
        assert json.loads(modeshape(*arguments).out)["recording"] == f"recordings/{name}"
        verify(Path("recordings", name))


def test_a_table_without_json(modeshape: Command, videos: Path) -> None:
    outcome = modeshape("run", videos / "turning.mp4", "--frames", ":4", "--image", "none")
    assert outcome.code == 0
    assert outcome.out.startswith("fair: ")
    for word in ("surface", "flat sheet", "frames", "error", "recording"):
        assert word in outcome.out
    assert len(outcome.out.splitlines()) <= 10
    assert "look at it with: rerun recordings/turning.rrd" in outcome.err


def test_all_of_it_if_asked_for(modeshape: Command, videos: Path) -> None:
    outcome = modeshape("run", videos / "turning.mp4", "--frames", ":4", "--image", "none", "--verbose")
    for word in ("verdict_reason", "reprojection_rms_px", "stage_ms", "plane"):
        assert word in outcome.out


@pytest.mark.parametrize("kind", ["plane", "rigid", "mesh"])
@pytest.mark.parametrize("camera", ["perspective", pytest.param("orthographic", marks=pytest.mark.slow)])
def test_every_rest_shape_and_camera(modeshape: Command, videos: Path, here: Path, kind: str, camera: str) -> None:
    corners = [(20, 20), (300, 20), (20, 220), (300, 220)]
    (here / "sheet.obj").write_text("".join(f"v {x} {y} 0\n" for x, y in corners) + "f 1 2 3\nf 2 4 3\n")
    outcome = modeshape(
        "run", videos / "turning.mp4", "--image", "none", "--json", "--camera", camera, "--points", 150, "--no-final-pass",
        "--rest-shape", "sheet.obj" if kind == "mesh" else kind, "--bootstrap-frames", 20, "--modes", 8,
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["rest_shape"] == kind
    assert words["reprojection_rms_px"] < (3 if camera == "perspective" else 6)
    assert words["deformation"] == "inextensible" or kind == "rigid"


@pytest.mark.parametrize("deformation", ["bending", "stretching", "general", "inextensible"])
@pytest.mark.parametrize("metric", ["euclidean", pytest.param("manhattan", marks=pytest.mark.slow)])
def test_every_deformation_and_metric(modeshape: Command, videos: Path, deformation: str, metric: str) -> None:
    outcome = modeshape(
        "run", videos / "turning.mp4", "--image", "none", "--json", "--frames", ":12", "--points", 120, "--window", 3,
        "--rest-shape", "plane", "--bootstrap-frames", 5, "--deformation", deformation, "--metric", metric, "--modes", 5,
        "--no-final-pass",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["deformation"] == deformation
    assert words["bootstrap_frames"] == 5


def test_the_papers_energy(modeshape: Command, videos: Path) -> None:
    outcome = modeshape(
        "run", videos / "turning.mp4", "--image", "none", "--json", "--frames", ":12", "--points", 120,
        "--camera", "orthographic", "--energy", "paper", "--deformation", "bending",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err


def test_evaluate_scores_against_the_truth(modeshape: Command, shared_data: Path) -> None:
    outcome = modeshape("evaluate", shared_data / "flag250.npz", "--rest-shape", "first-truth", "--json")
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words.keys() >= EVALUATE_KEYS
    assert (words["frames"], words["points"], words["modes"]) == (30, 250, 20)
    assert outcome.err == ""


def test_evaluate_repeats_itself_by_its_seed(modeshape: Command, shared_data: Path) -> None:
    def e3d(seed: int) -> float:
        arguments = ("--rest-shape", "first-truth", "--noise", 0.01, "--missing", 0.2, "--seed", seed, "--json")
        return float(json.loads(modeshape("evaluate", shared_data / "flag250.npz", *arguments).out)["e3d"])

    assert e3d(3) == e3d(3)
    assert e3d(3) != e3d(4)


@pytest.fixture(scope="module")
def long_video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("long") / "long.mp4", list(turning(80)) * 12)


@pytest.mark.parametrize("which", [signal.SIGINT, signal.SIGTERM], ids=lambda which: which.name)
def test_an_interrupt_keeps_everything_so_far(long_video: Path, tmp_path: Path, which: signal.Signals) -> None:
    files = ("--tracks-out", "tracks.npz", "--shapes-out", "shapes.npz", "--out", "run.rrd")
    process = subprocess.Popen(
        [*PROGRAM, "run", str(long_video), "--json", *QUICK, *files],
        cwd=tmp_path,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # background jobs ignore it
    )
    recording = tmp_path / "run.rrd"
    patience = time.monotonic() + 60
    while not (recording.exists() and recording.stat().st_size > 500_000):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < patience
        time.sleep(0.05)
    process.send_signal(which)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    words = json.loads(out)
    assert words["interrupted"] is True
    assert 1 < words["frames"] < 960
    verify(recording)
    with np.load(tmp_path / "tracks.npz") as tracks, np.load(tmp_path / "shapes.npz") as shapes:
        assert len(tracks["W"]) == words["frames"]
        assert len(shapes["S"]) == words["frames"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.rrd", "shapes.npz", "tracks.npz"]


def test_an_interrupted_run_prints_its_table(long_video: Path, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*PROGRAM, "run", str(long_video), *QUICK, "--out", "run.rrd"],
        cwd=tmp_path,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    recording = tmp_path / "run.rrd"
    patience = time.monotonic() + 60
    while not (recording.exists() and recording.stat().st_size > 100_000):
        assert process.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "interrupted" in out
    verify(recording)


def test_program_is_installed(tmp_path: Path) -> None:
    program = Path(PROGRAM[0]).with_name("modeshape")
    if not program.exists():
        pytest.skip("modeshape is run from its sources, not installed")
    done = subprocess.run([program, "--help"], cwd=tmp_path, env=os.environ, capture_output=True, text=True, check=True)
    assert "modeshape demo" in done.stdout
    assert in_own_process(tmp_path, "--help").out == done.stdout
