"""The frame loop: frame numbers, stages, interrupts at awkward moments."""

import json
import threading
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from app.files.video_out import writable_video
from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.pipeline.stages.working_copy import resized
from app.playback.images import stored_images
from app.playback.playback import Playback
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from reconstruction import ReconstructionError
from reconstruction.estimate import ShapeEstimate, Switch
from reconstruction.state import State
from reconstruction.window.window import SlidingWindow
from tests.synthetic_run import verify
from tracking.video import Video

LARGE = (2560, 1920)


def config(
    videos: Path, frames: str = ":20", rest_shape: str = "auto", *, final_pass: bool = False, **output: object
) -> Run:
    return Run(
        source=str(videos / "turning.mp4"),
        points=120,
        frames=frames,
        rest_shape=rest_shape,
        final_pass=final_pass,
        model=Model(modes=6),
        output=Output(out=Path("run.rrd"), image="none", **output),  # type: ignore[arg-type]
    )


def quick(videos: Path, **output: object) -> Run:
    """One whose bootstrap is over after five frames."""
    asked = config(videos, rest_shape="plane", **output)
    return replace(asked, model=replace(asked.model, bootstrap_frames=5))


class Impatient(Progress):
    """Somebody who presses Ctrl-C after some frames."""

    def __init__(self, frames: int) -> None:
        super().__init__()
        self.left = frames

    def advance(self, phase: str, error_px: float | None = None) -> None:
        super().advance(phase, error_px)
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


@pytest.fixture(autouse=True)
def in_folder(here: Path) -> None:
    """Recordings go to a folder of their own."""


def test_frames_keep_their_numbers_in_the_source(videos: Path) -> None:
    words = Session(config(videos, "7:25", final_pass=True, shapes_out=Path("shapes.npz")), Progress()).run().as_dict()
    assert words["frames"] == 18
    assert words["interrupted"] is False
    with np.load("shapes.npz") as shapes:
        assert shapes["frames"].tolist() == list(range(7, 25))


def test_large_pictures_are_recorded_smaller_and_results_are_in_their_pixels(videos: Path) -> None:
    small = quick(videos)
    with Video(small.source, 0, 20) as video, writable_video(Path("large.mp4"), LARGE, video.fps) as sink:
        factor = LARGE[0] / video.size[0]
        for frame in video:
            sink.write(resized(frame.image, LARGE), frame.time_s)
    output = replace(small.output, image="jpeg", out=Path("large.rrd"))
    Session(replace(small, source="large.mp4", output=output), Progress()).run()
    Session(small, Progress()).run()
    large, usual = Playback.load(Path("large.rrd")), Playback.load(Path("run.rrd"))
    stored = {image.shape[1::-1] for _, image in stored_images(large.file, large.frames.tolist()) if image is not None}
    assert stored == {(LARGE[0] // 2, LARGE[1] // 2)}
    assert {image.shape[1::-1] for _, image in large.images() if image is not None} == {LARGE}
    assert_allclose(np.nanmedian(large.W, axis=2), factor * np.nanmedian(usual.W, axis=2), atol=0.05 * LARGE[0])


def test_stages_add_up_to_the_time_it_took(videos: Path) -> None:
    words = Session(config(videos, final_pass=True), Progress()).run().as_dict()
    assert isinstance(words["stage_ms"], dict)
    assert isinstance(words["fps"], float)
    assert min(words["stage_ms"].values()) >= 0
    here = words["stage_ms"]["reconstruct"] + words["stage_ms"]["record"]
    assert here <= 1.05 * 1000 / words["fps"]


@pytest.mark.parametrize("rest_shape", ["auto", "plane", "rigid"])
@pytest.mark.parametrize("frames", [1, 3, 9, 18])
def test_interrupts_keep_the_recording_at_any_moment(videos: Path, frames: int, rest_shape: str) -> None:
    words = Session(config(videos, rest_shape=rest_shape), Impatient(frames)).run().as_dict()
    assert words["interrupted"] is True
    assert words["frames"] == frames
    verify(Path("run.rrd"))


def test_a_failed_run_leaves_nothing(videos: Path, here: Path) -> None:
    files = {"tracks_out": Path("tracks.npz"), "shapes_out": Path("shapes.npz")}
    with pytest.raises(ReconstructionError, match="cannot recover a rest shape"):
        Session(config(videos, ":5", "rigid", **files), Progress()).run().as_dict()
    assert list(here.iterdir()) == []


def test_an_interrupt_without_a_shape_writes_the_tracks_it_has(videos: Path) -> None:
    files = {"tracks_out": Path("tracks.npz"), "shapes_out": Path("shapes.npz")}
    words = Session(config(videos, rest_shape="rigid", **files), Impatient(3)).run().as_dict()
    assert words["rest_shape"] is None
    with np.load("tracks.npz") as tracks:
        assert len(tracks["W"]) == 3
    assert not Path("shapes.npz").exists()


def test_existing_files_are_noticed_before_the_work(videos: Path) -> None:
    Path("shapes.npz").write_text("somebody's work")
    with pytest.raises(UsageError, match=r"shapes\.npz exists"):
        Session(config(videos, shapes_out=Path("shapes.npz")), Progress())
    assert Path("shapes.npz").read_text() == "somebody's work"


def test_priors_are_recorded_as_they_were_asked_for_and_as_they_were(videos: Path) -> None:
    asked = config(videos)
    words = (
        Session(replace(asked, model=replace(asked.model, priors={"rest": 0.5, "scale": 0})), Progress()).run().as_dict()
    )
    playback = Playback.load(Path("run.rrd"))
    assert playback.configuration["priors"] == "rest=0.5,scale=0"
    assert playback.summary is not None
    assert playback.summary["priors"] == words["priors"]
    assert words["priors"] == {
        "rest": 0.5, "smoothness": 1e-4, "rotation": 3e-4, "scale": 0.0, "inextensibility": 1.0,
    }  # fmt: skip


def test_a_switch_of_branches_is_told_and_counted(
    videos: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    advance = SlidingWindow.advance

    def switching(self: SlidingWindow, W: np.ndarray, visible: np.ndarray, expected: State | None = None) -> ShapeEstimate:
        estimate = advance(self, W, visible, expected)
        return replace(estimate, switch=Switch(-0.5, 0.0, 0.62)) if estimate.frame == 4 else estimate

    monkeypatch.setattr(SlidingWindow, "advance", switching)
    words = Session(config(videos, "7:25"), Progress()).run().as_dict()
    told = "bent back at frame 11: energy 0.62 of the other branch"
    assert words["branch_switches"] == 1
    assert told in capsys.readouterr().err
    events = [(frame, level, text) for frame, _, level, text in Playback.load(Path("run.rrd")).events]
    assert (11, "WARN", told) in events


def test_frames_are_given_as_soon_as_their_shapes_are_known(videos: Path) -> None:
    session = Session(config(videos, "7:25"), Progress())
    processed = list(session.frames())
    assert [one.frame.index for one in processed] == list(range(7, 25))
    assert session.summary.frames == 18
    assert not session.interrupted
    surface = processed[0].surface
    assert surface is not None
    np.testing.assert_array_equal(surface.points_px, processed[0].observation.points_px)
    for one in processed:
        assert one.surface is surface
        assert one.estimate is not None
        assert one.estimate.shape.shape == (3, len(surface.points_px))


def test_whoever_wants_no_more_frames_keeps_what_there_was(videos: Path) -> None:
    before = set(threading.enumerate())
    session = Session(quick(videos, tracks_out=Path("tracks.npz")), Progress())
    with closing(session.frames()) as frames:
        assert next(frames).frame.index == 0
    assert session.summary.interrupted
    assert 0 < session.summary.frames < 20
    verify(Path("run.rrd"))
    assert Playback.load(Path("run.rrd")).summary == json.loads(json.dumps(session.summary.as_dict()))
    with np.load("tracks.npz") as tracks:
        assert len(tracks["W"]) == session.summary.frames
    for thread in set(threading.enumerate()) - before:
        thread.join(10)
        assert not thread.is_alive(), thread


def test_whoever_follows_can_end_it(videos: Path) -> None:
    session = Session(quick(videos), Progress(), record=False)
    for one in session.frames():
        if one.frame.index == 5:
            session.interrupted = True
    assert session.summary.interrupted
    assert session.summary.frames < 20


def test_no_recording_is_written_that_nobody_asked_for(videos: Path, here: Path) -> None:
    summary = Session(replace(config(videos), output=Output()), Progress(), record=False).run()
    assert summary.recording is None
    assert "recording" not in summary.as_dict()
    assert list(here.iterdir()) == []
