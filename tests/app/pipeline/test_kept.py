"""Whatever a run fails at, what is known already is kept."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.files.stored_tracks import StoredFrame, StoredTracks
from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.processes.child import child, shared_file
from app.processes.ring import MOST, Ring
from app.recording.process import RecordingProcess
from app.terminal.progress import Progress
from reconstruction import ReconstructionError
from tests.app.command_line import still, turning, write_video
from tests.synthetic_run import SIZE, verify

KEPT = {"tracks_out": Path("tracks.npz"), "shapes_out": Path("shapes.npz")}


@pytest.fixture(autouse=True)
def in_folder(here: Path) -> None:
    """Files go to a folder of their own."""


def config(video: Path, frames: str = ":40", **output: object) -> Run:
    written = Output(out=Path("run.rrd"), image="none", **output)  # type: ignore[arg-type]
    return Run(source=str(video), points=120, frames=frames, model=Model(modes=6, bootstrap_frames=10), output=written)


def shapes() -> tuple[int, int]:
    """How many are in the file of shapes, and how many of them are known."""
    with np.load("shapes.npz") as file:
        return len(file["S"]), int(np.isfinite(file["S"]).all(axis=(1, 2)).sum())


def test_truth_beside_the_surface_costs_the_scores_alone(videos: Path) -> None:
    np.savez(
        "truth.npz",
        W_px=np.full((1, 2, 9), 5.0) + np.arange(9) / 9,
        S_gt=np.random.default_rng(0).random((1, 3, 9)),
        gt_frames=[0],
    )
    asked = replace(config(videos / "turning.mp4", **KEPT), ground_truth=Path("truth.npz"))
    with pytest.raises(ReconstructionError, match="fewer than 3 truth points"):
        Session(asked, Progress()).run()
    assert shapes() == (40, 40)
    with np.load("tracks.npz") as tracks:
        assert len(tracks["W"]) == 40


def test_a_final_pass_that_is_broken_off_leaves_the_shapes_of_before(videos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = StoredTracks.told_ahead

    def broken_off(stored: StoredTracks, tell: Callable[[list[StoredFrame]], None]) -> Iterator[StoredFrame]:
        for k, one in enumerate(whole(stored, tell)):
            if k == 7:
                raise KeyboardInterrupt
            yield one

    monkeypatch.setattr(StoredTracks, "told_ahead", broken_off)
    summary = Session(config(videos / "turning.mp4", ":40", **KEPT), Progress()).run()
    assert summary.interrupted
    assert summary.shapes == "on-line"
    assert shapes() == (40, 40)


def test_frames_before_a_loss_have_their_shapes(tmp_path: Path) -> None:
    """Also those that still waited when the surface was lost."""
    video = write_video(tmp_path / "gone.mp4", [*turning(14), *(0 * picture for picture in still(20))])
    processed = list(Session(config(video, ":"), Progress()).frames())
    recorded = Playback.load(Path("run.rrd"))
    assert [one.estimate is not None for one in processed] == recorded.shaped.tolist()
    assert recorded.shaped.sum() == 14


def test_each_part_of_a_recording_has_the_shapes_of_its_frames(videos: Path) -> None:
    summary = Session(config(videos / "turning.mp4", ":40", split_minutes=0.004), Progress()).run()
    assert summary.frames == 40
    parts = sorted(Path().glob("run*.rrd"))
    assert len(parts) > 1
    for part in parts:
        verify(part)
        assert Playback.load(part).shaped.all()
        assert b"modes" in part.read_bytes()


def test_nobody_waits_for_pictures_to_be_recorded_when_that_has_ended() -> None:
    file = shared_file()
    pictures = Ring(file, SIZE)
    recording = RecordingProcess(child("app.recording.process", file), pictures)
    assert recording._process is not None
    recording._process.kill()
    for number in range(2 * MOST):
        pictures.write(number, np.zeros((*SIZE[::-1], 3), np.uint8))
