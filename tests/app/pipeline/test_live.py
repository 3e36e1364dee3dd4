"""Live sources: the newest frame, a server that comes back, and the end by time."""

import itertools
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.terminal.progress import Progress
from tests.app.command_line import Command, turning
from tests.app.mjpeg import RATE, Camera, number_in
from tracking import TrackingError
from tracking.guarded import Guarded, GuardedTracker
from tracking.video import Video

PICTURES = [*turning(40), *list(turning(40))[::-1]]
STEP_S = 0.05  # of the throttled pipeline: three frames


@pytest.fixture
def camera() -> Iterator[Camera]:
    with Camera(PICTURES) as camera:
        yield camera


@pytest.fixture(autouse=True)
def in_folder(here: Path) -> None:
    """Recordings go to a folder of their own."""


class Throttled(Progress):
    """Takes its time after every frame."""

    def advance(self, phase: str, error_px: float | None = None) -> None:
        super().advance(phase, error_px)
        time.sleep(STEP_S)


def test_the_newest_frame_is_taken(camera: Camera) -> None:
    late, numbers = [], []
    with Video(camera.url, drop_late=True) as video:
        assert video.live
        assert video.frame_count is None
        for frame in itertools.islice(video, 40):
            numbers.append(number_in(frame.image))
            late.append(camera.now - numbers[-1])
            time.sleep(STEP_S)
    assert np.diff(numbers).min() > 0
    assert np.mean(np.diff(numbers)) > 2  # frames were left out
    assert np.median(late[2:]) < RATE / 3  # one after another, they would be twice as late


def test_a_throttled_pipeline_stays_up_to_date(camera: Camera, monkeypatch: pytest.MonkeyPatch) -> None:
    late: list[int] = []
    track = GuardedTracker.track

    def noted(self: GuardedTracker, image: np.ndarray, predicted_px: np.ndarray | None = None) -> Guarded:
        late.append(camera.now - number_in(image))
        return track(self, image, predicted_px)

    monkeypatch.setattr(GuardedTracker, "track", noted)
    run = Run(
        source=camera.url, roi=(40, 40, 240, 160), points=100, rest_shape="plane", drop_late=True, duration=5.0, jobs=1,
        model=Model(modes=5, bootstrap_frames=5), output=Output(out=Path("live.rrd")),
    )  # fmt: skip
    words = Session(run, Throttled()).run().as_dict()
    assert words["frames"] < 0.7 * 5 * RATE
    assert np.median(late[5:]) < RATE, late  # all of them, one after another, would be three times as late in the end
    playback = Playback.load(Path("live.rrd"))
    assert np.diff(playback.frames).max() > 1  # the numbers tell what was left out
    assert 4.0 < playback.times_s[-1] - playback.times_s[0] < 5.0


def test_a_server_that_comes_back_is_used_again(camera: Camera) -> None:
    said: list[str] = []
    numbers = []
    with Video(camera.url, log=said.append) as video:
        for count, frame in enumerate(video):
            numbers.append(number_in(frame.image))
            if count == 20:
                camera.stop()
                time.sleep(1.0)
                camera.start()
            if count == 60:
                break
    assert len(said) == 2
    assert "broke: connecting again" in said[0]
    assert "resumed after" in said[1]
    assert np.diff(numbers).max() > 30
    assert (np.diff(numbers) > 0).all()


def test_time_ends_a_run_even_when_the_server_is_gone(camera: Camera) -> None:
    said: list[str] = []
    with Video(camera.url, duration_s=2.0, log=said.append) as video:
        for count, _ in enumerate(video):
            if count == 10:
                camera.stop()
    assert not any("did not come back" in text for text in said)


def test_duration_of_a_file(modeshape: Command, videos: Path) -> None:
    outcome = modeshape("run", videos / "still.mp4", "--duration", 0.5, "--image", "none", "--json", "--points", 100)
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["frames"] == 15


def test_frames_of_a_file_are_never_late(videos: Path) -> None:
    with pytest.raises(TrackingError, match="no camera or stream"):
        Video(str(videos / "still.mp4"), drop_late=True)


def test_nobody_serves(modeshape: Command) -> None:
    outcome = modeshape("run", "http://127.0.0.1:9/stream.mjpg")
    assert outcome.code == 2
    assert "check the address" in outcome.err


def test_recordings_in_parts(modeshape: Command, videos: Path) -> None:
    arguments = ("--rest-shape", "plane", "--bootstrap-frames", 5, "--points", 100, "--split-minutes", 0.5 / 60, "--json")
    outcome = modeshape("run", videos / "still.mp4", "--out", "day.rrd", *arguments)
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["parts"] == 5
    assert words["last_part"] == "day-part5.rrd"
    frames: list[int] = []
    for name in ("day", "day-part2", "day-part3", "day-part4", "day-part5"):
        playback = Playback.load(Path(f"{name}.rrd"))
        assert playback.recorded_model is not None
        assert playback.summary is not None
        assert playback.shaped.all()
        frames += playback.frames.tolist()
    assert frames == list(range(70))
