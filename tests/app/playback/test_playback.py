"""A recording, read back."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.recording.recording import Recording
from app.recording.stream import BATCH_ROWS
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from reconstruction.basis.modes import modal_basis
from reconstruction.camera import Camera, quaternion_from_rotation, rotation_from_quaternion
from tests.synthetic_run import MODES, SIZE, STAGE_MS, write_run
from tests.synthetic_run import Run as Made
from tracking.observation import Observation
from tracking.video import Frame, Video

ROOT = Path(__file__).parents[3]
ORTHOGRAPHIC = Camera(center_px=np.array([80.0, 60.0]))

KILLED = """
import os, signal, sys
from pathlib import Path
import numpy as np
from app.recording.recording import Recording
from app.recording.stream import BATCH_ROWS
from tracking.observation import Observation
from tracking.video import Frame

recording = Recording(Path(sys.argv[1]), configuration={"modes": 4}, size=(160, 120))
for index in range(BATCH_ROWS + 5):
    points = np.full((5, 2), float(index))
    observation = Observation(points, np.ones(5, bool))
    recording.observe(Frame(index, index / 30, np.zeros((120, 160, 3), np.uint8)), observation, phase="bootstrap")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("camera", [None, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_what_was_written_is_read(tmp_path: Path, camera: Camera | None) -> None:
    run = write_run(tmp_path / "sheet.rrd", camera=camera)
    playback = Playback.load(run.path)
    assert (playback.name, playback.version, playback.notes) == ("sheet", "0.1.0", ())
    assert playback.configuration == {"source": "sheet.mp4", "modes": MODES}
    assert playback.summary == {"frames": 6, "e3d": 0.03}
    assert playback.frames.tolist() == list(range(6))
    assert np.allclose(playback.times_s, np.arange(6) / 30, atol=1e-9)
    assert playback.phases == ["bootstrap"] * 2 + ["tracking"] * 4
    assert list(playback.stage_ms) == list(STAGE_MS)
    assert [values.tolist() for values in playback.stage_ms.values()] == [[value] * 6 for value in STAGE_MS.values()]
    assert [(frame, level, text) for frame, _, level, text in playback.events] == [(2, "INFO", "rest shape: plane")]
    assert playback.visible.tolist() == [o.visible.tolist() for o in run.observations]
    observed = np.stack([o.points_px.T for o in run.observations])
    assert np.allclose(playback.W, observed, atol=1e-4, equal_nan=True)
    assert playback.size == SIZE
    assert playback.camera.perspective == run.camera.perspective
    assert np.array_equal(playback.mesh.faces, run.mesh.faces)
    assert np.array_equal(playback.mesh.edges, run.mesh.edges)
    for name in ("rest", "Upsilon", "eigenvalues", "Phi"):
        assert np.array_equal(getattr(playback.basis, name), getattr(run.basis, name))
    assert np.array_equal(playback.texture_px, run.pixels)
    x, y = playback.texture_origin
    height, width = playback.texture_bgr.shape[:2]
    assert np.array_equal(playback.texture_bgr, run.picture[y : y + height, x : x + width])


@pytest.mark.parametrize("camera", [None, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_shapes_are_exact(tmp_path: Path, camera: Camera | None) -> None:
    run = write_run(tmp_path / "sheet.rrd", camera=camera)
    playback = Playback.load(run.path)
    shapes = playback.shapes()
    assert playback.shaped.all()
    for i, written in enumerate(run.estimates):
        read = playback.estimate(i)
        assert read is not None
        assert np.array_equal(read.Lambda, written.Lambda) or np.allclose(read.Lambda, written.Lambda, atol=1e-12)
        assert np.allclose(read.R, written.R, atol=1e-12)
        assert np.allclose(read.shape, written.shape, atol=1e-9)
        assert np.allclose(shapes[i], written.shape, atol=1e-9)
        assert np.allclose(read.projection_px, written.projection_px, atol=1e-9)
        assert np.allclose(read.residual_px, written.residual_px, atol=1e-4, equal_nan=True)


def test_of_a_frame_that_is_estimated_again_the_last_counts(tmp_path: Path) -> None:
    path = tmp_path / "again.rrd"
    run = write_run(tmp_path / "sheet.rrd")
    with Recording(path, configuration={}, size=SIZE) as recording:
        for index in range(3):
            recording.observe(Frame(index, index / 30, run.picture), run.observations[0], phase="tracking")
        recording.rest(run.basis, run.mesh, run.camera, run.picture, run.pixels)
        for index in (2, 1, 1, 2, 1):  # out of order, too
            recording.estimate(index, index / 30, run.estimates[index])
        corrected = replace(run.estimates[1], s=0.5, Lambda=run.estimates[1].Lambda + 1)
        recording.estimate(1, 1 / 30, corrected)
        recording.event(1, 1 / 30, "first")
        recording.event(1, 1 / 30, "second", "WARN")
    playback = Playback.load(path)
    assert playback.estimates.s[1:].tolist() == [0.5, 1.0]
    assert np.array_equal(playback.estimates.Lambda[1], corrected.Lambda)
    assert playback.shaped.tolist() == [False, True, True]
    assert playback.estimate(0) is None
    assert np.isnan(playback.shapes()[0]).all()
    assert [(level, text) for _, _, level, text in playback.events] == [("INFO", "first"), ("WARN", "second")]


def test_frames_without_a_single_point_seen(tmp_path: Path) -> None:
    path = tmp_path / "dark.rrd"
    picture = np.zeros((120, 160, 3), np.uint8)
    with Recording(path, configuration={}, size=SIZE) as recording:
        for index, seen in enumerate((True, False, True)):
            points = np.full((4, 2), 7.0 if seen else np.nan)
            recording.observe(Frame(index, index / 30, picture), Observation(points, np.full(4, seen)), phase="lost")
    playback = Playback.load(path)
    assert playback.visible.any(axis=1).tolist() == [True, False, True]
    assert np.isnan(playback.W[1]).all()


def test_run_without_a_model(tmp_path: Path) -> None:
    """As after a run that ended while it bootstrapped."""
    run = write_run(tmp_path / "early.rrd", frames=4, first_shape=9)
    playback = Playback.load(run.path)
    assert playback.recorded_model is None
    assert not playback.shaped.any()
    assert "contains no shapes" in " ".join(playback.notes)
    for use in (
        lambda: playback.model,
        playback.shapes,
        lambda: playback.estimate(0),
        lambda: playback.basis,
        lambda: playback.texture_bgr,
    ):
        with pytest.raises(UsageError, match=r"early\.rrd contains no model.*--rest-shape plane"):
            use()
    assert sum(picture is not None for _, picture in playback.images()) == 4


def test_killed_run(tmp_path: Path) -> None:
    path = tmp_path / "killed.rrd"
    done = subprocess.run([sys.executable, "-c", KILLED, path], cwd=ROOT, check=False)
    assert done.returncode == -9
    playback = Playback.load(path)
    assert len(playback.frames) >= BATCH_ROWS
    assert playback.frames.tolist() == list(range(len(playback.frames)))
    assert playback.configuration == {"modes": 4}
    assert playback.summary is None
    assert "no summary" in playback.notes[0]
    assert len([picture for _, picture in playback.images() if picture is not None]) == len(playback.frames)


@pytest.mark.parametrize("image", ["jpeg", "video"])
def test_real_run(tmp_path: Path, shared_data: Path, image: str) -> None:
    """Shapes agree with --shapes-out, and pictures with the video's frames."""
    source, shapes, out = shared_data / "kinect_paper.mp4", tmp_path / "shapes.npz", tmp_path / "run.rrd"
    config = Run(
        source=str(source),
        roi=(195, 95, 325, 265),
        frames="10:26",
        rest_shape="plane",
        points=300,
        model=Model(bootstrap_frames=8),
        output=Output(out=out, shapes_out=shapes, image=image),  # type: ignore[arg-type]
    )
    summary = Session(config, Progress()).run().as_dict()
    playback = Playback.load(out)
    assert playback.summary is not None
    assert playback.summary["frames"] == summary["frames"] == 16
    with np.load(shapes) as saved:
        assert playback.frames.tolist() == saved["frames"].tolist() == list(range(10, 26))
        assert np.allclose(playback.shapes(), saved["S"], rtol=1e-9, atol=1e-9)
        for name in ("t", "s", "Lambda"):
            assert np.array_equal(getattr(playback.estimates, name), saved[name]), name
        assert np.array_equal(playback.visible, saved["visible"])
        for name in ("rest", "Upsilon", "eigenvalues", "Phi"):
            assert np.array_equal(getattr(playback.basis, name), saved[name]), name
        assert np.array_equal(playback.mesh.faces, saved["faces"])
        assert np.array_equal(playback.camera.K, saved["K"])
    residuals = [estimate.residual_px for i in range(16) if (estimate := playback.estimate(i))]
    rms = np.sqrt(np.nanmean(np.square(residuals)))
    assert rms == pytest.approx(summary["reprojection_rms_px"], rel=1e-4)
    with Video(str(source), 10, 26) as video:
        for (_, picture), frame in zip(playback.images(), video, strict=True):
            assert picture is not None
            assert cv2.PSNR(picture, frame.image) > 30


def test_shapes_of_an_earlier_model_are_as_they_were_and_as_near_as_the_last_one_comes(tmp_path: Path, run: Made) -> None:
    """A model may be replaced on the way: more modes, another pose of the rest shape."""
    first = run.estimates[-1]
    R = rotation_from_quaternion(np.array([np.cos(0.2), 0.0, np.sin(0.2), 0.0]))
    rest = R @ run.basis.rest
    other = modal_basis(rest, run.mesh, 2 * MODES)
    picture, seen = np.zeros((*SIZE[::-1], 3), np.uint8), Observation(run.pixels, np.ones(len(run.pixels), bool))
    with Recording(tmp_path / "two.rrd", configuration={}, size=SIZE) as recording:
        for frame, basis in enumerate((run.basis, other)):
            recording.observe(Frame(frame, frame / 30, picture), seen, phase="tracking")
            recording.rest(basis, run.mesh, run.camera, picture, run.pixels)
            own = first if frame == 0 else replace(first, R=first.R @ R.T, Lambda=np.zeros((3, 2 * MODES)))
            quaternion = quaternion_from_rotation(own.R)
            recording.estimate(frame, frame / 30, replace(own, quaternion=quaternion))
    playback = Playback.load(tmp_path / "two.rrd")
    assert playback.basis.rest == pytest.approx(rest)
    assert playback.estimates.Lambda.shape == (2, 3, 2 * MODES)
    as_it_was = playback.estimate(0)
    as_near = replace(playback.estimates, before={}).of(0, playback.model, playback.W[0], playback.visible[0])
    assert as_it_was is not None
    for earlier, off_px, share in ((as_it_was, 1e-3, 1e-5), (as_near, 0.5, 0.02)):
        assert np.abs(earlier.projection_px - first.projection_px).max() < off_px
        centred = [S - S.mean(axis=1, keepdims=True) for S in (earlier.shape, first.shape)]
        assert np.linalg.norm(centred[0] - centred[1]) < share * np.linalg.norm(centred[1])


def test_what_was_shown_on_the_way_is_kept_if_wanted(tmp_path: Path, run: Made) -> None:
    picture, seen = np.zeros((*SIZE[::-1], 3), np.uint8), Observation(run.pixels, np.ones(len(run.pixels), bool))
    before, after = run.estimates[-2:]
    for keep in (True, False):
        path = tmp_path / f"{keep}.rrd"
        with Recording(path, configuration={}, size=SIZE, keep_online=keep) as recording:
            recording.observe(Frame(0, 0.0, picture), seen, phase="tracking")
            recording.rest(run.basis, run.mesh, run.camera, picture, run.pixels)
            recording.estimate(0, 0.0, before)
            recording.final_pass()
            recording.rest(run.basis, run.mesh, run.camera, picture, run.pixels)
            recording.estimate(0, 0.0, after)
        assert np.array_equal(Playback.load(path).estimates.Lambda[0], after.Lambda)
        if keep:
            assert Playback.load(path, online=True).estimates.Lambda[0] == pytest.approx(before.Lambda)
        else:
            with pytest.raises(UsageError, match="--keep-online"):
                Playback.load(path, online=True)
