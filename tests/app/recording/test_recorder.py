"""Recordings that another process writes: nothing is lost, and what goes wrong there is heard here."""

import subprocess
import sys
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from app.playback.playback import Playback
from app.recording.recorder import MOST_UNANSWERED, Recorder, receive, send
from app.terminal.errors import UsageError
from tests.synthetic_run import SIZE, Run, verify, write_run
from tracking.video import Frame


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("here") / "here.rrd", frames=40, first_shape=0)


def tell(recording: Recorder, run: Run) -> None:
    mesh, image = run.mesh, run.picture
    for index, (observation, estimate) in enumerate(zip(run.observations, run.estimates, strict=True)):
        recording.observe(Frame(index, index / 30, image), observation, phase="tracking")
        if index == 0:
            recording.rest(run.basis, mesh.faces, mesh.edges, run.camera, texture_bgr=image, texture_px=run.pixels)
        recording.estimate(index, index / 30, estimate)
        recording.timing(index, index / 30, {"track": 1.0})


def repeat(what: Callable[[], None], times: int) -> None:
    for _ in range(times):
        what()


def test_it_is_the_recording_that_would_be_written_here(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "elsewhere.rrd"
    recording = Recorder(path, configuration={}, size=SIZE)
    tell(recording, run)
    recording.summary({"frames": 40})
    recording.close()
    verify(path)
    here, there = Playback.load(run.path), Playback.load(path)
    np.testing.assert_array_equal(there.shapes(), here.shapes())
    np.testing.assert_array_equal(there.texture_bgr, here.texture_bgr)
    for (_, mine), (_, theirs) in zip(here.images(), there.images(), strict=True):
        np.testing.assert_array_equal(theirs, mine)
    assert there.summary == {"frames": 40}


def test_pictures_that_are_not_stored_are_not_sent(tmp_path: Path, run: Run) -> None:
    recording = Recorder(tmp_path / "run.rrd", image="none", configuration={}, size=SIZE)
    tell(recording, run)
    recording.close()
    playback = Playback.load(tmp_path / "run.rrd")
    assert playback.shaped.sum() == 40
    assert all(image is None for _, image in playback.images())


def test_modules_that_lie_about_are_not_imported(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("numpy", "org"):  # one that is needed, one that a library looks for
        (tmp_path / f"{name}.py").write_text("print('this is not the module that was meant')")
    monkeypatch.chdir(tmp_path)
    recording = Recorder(tmp_path / "run.rrd", configuration={}, size=SIZE)
    tell(recording, run)
    recording.close()
    assert Playback.load(tmp_path / "run.rrd").shaped.sum() == 40


def test_what_nobody_reads_needs_no_process(run: Run) -> None:
    recording = Recorder(None, configuration={}, size=SIZE)
    assert recording._process is None
    tell(recording, run)
    recording.close()


def test_a_file_that_is_there_is_left_alone(tmp_path: Path, run: Run) -> None:
    (tmp_path / "there.rrd").write_bytes(b"something")
    recording = Recorder(tmp_path / "there.rrd", configuration={}, size=SIZE)
    with pytest.raises(UsageError, match=r"there.rrd exists.*--overwrite"):
        tell(recording, run)
    recording.__exit__(UsageError, UsageError(), None)
    assert (tmp_path / "there.rrd").read_bytes() == b"something"


def test_what_goes_wrong_is_raised_some_calls_later(tmp_path: Path) -> None:
    recording = Recorder(tmp_path / "run.rrd", configuration={}, size=SIZE)
    recording.event("no number", 0.0, "")  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        repeat(lambda: recording.event(0, 0.0, "fine"), MOST_UNANSWERED + 1)
    recording.close()


def test_what_goes_wrong_at_last_is_raised_at_the_end(tmp_path: Path) -> None:
    recording = Recorder(tmp_path / "run.rrd", configuration={}, size=SIZE)
    recording.event("no number", 0.0, "")  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        recording.close()


def test_a_process_that_was_killed_is_told(tmp_path: Path, run: Run) -> None:
    recording = Recorder(tmp_path / "run.rrd", configuration={}, size=SIZE)
    assert recording._process is not None
    recording._process.kill()
    with pytest.raises(UsageError, match="the process that writes the recording has ended"):
        repeat(lambda: tell(recording, run), 100)
    recording.__exit__(UsageError, UsageError(), None)


ORPHAN = """
import sys
from pathlib import Path
import tests.app.recording.test_recorder as t
from tests.synthetic_run import SIZE, write_run
run = write_run(Path(sys.argv[1]) / "here.rrd", frames=40, first_shape=0)
t.tell(t.Recorder(Path(sys.argv[1]) / "run.rrd", configuration={}, size=SIZE), run)
import os
os._exit(1)
"""


def test_what_a_run_said_before_it_was_killed_is_written(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-c", ORPHAN, str(tmp_path)], cwd=Path(__file__).parents[3], check=False)
    patience = time.monotonic() + 20
    while True:
        try:
            verify(tmp_path / "run.rrd")
            break
        except AssertionError:
            assert time.monotonic() < patience
            time.sleep(0.1)
    assert Playback.load(tmp_path / "run.rrd").shaped.sum() == 40


@pytest.mark.parametrize("message", [None, ("observe", (np.arange(6.0).reshape(2, 3)[:, ::2],), {}), ValueError("no")])
def test_messages_arrive_as_they_were_sent(message: object) -> None:
    stream = BytesIO()
    for _ in range(2):
        send(stream, message)
    stream.seek(0)
    assert repr(receive(stream)) == repr(message)
    assert repr(receive(stream)) == repr(message)
    with pytest.raises(EOFError):
        receive(stream)


def test_half_a_message_is_none() -> None:
    stream = BytesIO()
    send(stream, np.zeros(100))
    with pytest.raises(EOFError):
        receive(BytesIO(stream.getvalue()[:-1]))
