"""Recordings that another process writes: nothing is lost, and what goes wrong there is heard here."""

import pickle
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.playback.playback import Playback
from app.processes.child import child, shared_file
from app.processes.ring import Ring
from app.recording.process import MOST_WAITING, RecordingProcess
from app.terminal.errors import UsageError
from tests.synthetic_run import SIZE, Run, verify, write_run
from tracking.video import Frame


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("here") / "here.rrd", frames=40, first_shape=0)


def opened(path: Path, **options: object) -> RecordingProcess:
    file = shared_file()
    recording = RecordingProcess(child("app.recording.process", file), Ring(file, SIZE))
    recording.tell("open", path, configuration={}, size=SIZE, **options)
    return recording


def tell(recording: RecordingProcess, run: Run, begin: int = 0) -> None:
    mesh, image = run.mesh, run.picture
    for index, (observation, estimate) in enumerate(zip(run.observations, run.estimates, strict=True), begin):
        recording.tell("observe", Frame(index, index / 30, image), observation, phase="tracking")
        if index == begin:
            recording.tell("rest", run.basis, mesh, run.camera, image, run.pixels)
        recording.tell("estimate", index, index / 30, estimate)
        recording.tell("timing", index, index / 30, {"track": 1.0})


def repeat(what: Callable[[], None], times: int) -> None:
    for _ in range(times):
        what()


def test_it_is_the_recording_that_would_be_written_here(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "elsewhere.rrd"
    recording = opened(path)
    tell(recording, run)
    recording.tell("summary", {"frames": 40})
    recording.close()
    verify(path)
    here, there = Playback.load(run.path), Playback.load(path)
    np.testing.assert_array_equal(there.frames, range(40))
    np.testing.assert_array_equal(there.shapes(), here.shapes())
    np.testing.assert_array_equal(there.texture_bgr, here.texture_bgr)
    for (_, mine), (_, theirs) in zip(here.images(), there.images(), strict=True):
        np.testing.assert_array_equal(theirs, mine)
    assert there.summary == {"frames": 40}


def test_one_process_writes_one_recording_after_another(tmp_path: Path, run: Run) -> None:
    with opened(tmp_path / "first.rrd") as recording:
        tell(recording, run)
        recording.tell("open", tmp_path / "second.rrd", configuration={}, size=SIZE)
        tell(recording, run, begin=40)
    for name, begin in (("first", 0), ("second", 40)):
        verify(tmp_path / f"{name}.rrd")
        playback = Playback.load(tmp_path / f"{name}.rrd")
        assert playback.frames.tolist() == list(range(begin, begin + 40))
        assert playback.shaped.all()


def test_modules_that_lie_about_are_not_imported(tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("numpy", "org"):  # one that is needed, one that a library looks for
        (tmp_path / f"{name}.py").write_text("print('this is not the module that was meant')")
    monkeypatch.chdir(tmp_path)
    with opened(tmp_path / "run.rrd") as recording:
        tell(recording, run)
    assert Playback.load(tmp_path / "run.rrd").shaped.sum() == 40


def test_it_loads_no_command_line_and_draws_no_figures() -> None:
    code = "import sys, app.recording.process, app.recording.recording; print(*sys.modules)"
    command, root = [sys.executable, "-c", code], Path(__file__).parents[3]
    loaded = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    assert not {"matplotlib", "scipy", "tyro", "app.commands", "app.options"} & set(loaded.stdout.split())


def test_what_nobody_reads_needs_no_process(run: Run) -> None:
    recording = RecordingProcess(None, Ring(shared_file(), SIZE))
    assert recording._process is None
    tell(recording, run)
    recording.close()


def test_a_file_that_is_there_is_left_alone(tmp_path: Path, run: Run) -> None:
    (tmp_path / "there.rrd").write_bytes(b"something")
    with pytest.raises(UsageError, match=r"there.rrd exists.*--overwrite"), opened(tmp_path / "there.rrd") as recording:
        repeat(lambda: tell(recording, run), 10)
    assert (tmp_path / "there.rrd").read_bytes() == b"something"


def test_what_goes_wrong_is_raised_by_a_later_call_and_nothing_more_is_written(tmp_path: Path, run: Run) -> None:
    recording = opened(tmp_path / "run.rrd")
    tell(recording, run)
    recording.tell("event", "no number", 0.0, "")
    with pytest.raises(TypeError):
        repeat(lambda: tell(recording, run, begin=40), 100)
    recording.close()
    assert Playback.load(tmp_path / "run.rrd").frames.tolist() == list(range(40))


def test_what_goes_wrong_at_last_is_raised_at_the_end(tmp_path: Path) -> None:
    recording = opened(tmp_path / "run.rrd")
    recording.tell("event", "no number", 0.0, "")
    with pytest.raises(TypeError):
        recording.close()


def test_what_cannot_be_sent_is_raised_too(tmp_path: Path) -> None:
    recording = opened(tmp_path / "run.rrd")
    recording.tell("summary", {"frames": lambda: 0})
    with pytest.raises((AttributeError, pickle.PicklingError)):  # noqa: PT012 - heard sooner or later
        repeat(lambda: recording.tell("event", 0, 0.0, "fine"), 10 * MOST_WAITING)
        recording.close()
    recording.close()


def test_what_ended_the_run_matters_more(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="camera"), opened(tmp_path / "run.rrd") as recording:  # noqa: PT012
        recording.tell("event", "no number", 0.0, "")
        raise RuntimeError("camera")


def test_a_process_that_was_killed_is_told(tmp_path: Path, run: Run) -> None:
    recording = opened(tmp_path / "run.rrd")
    assert recording._process is not None
    recording._process.kill()
    with pytest.raises(UsageError, match="the process that writes the recording has ended"):
        repeat(lambda: tell(recording, run), 100)
    recording.__exit__(UsageError, UsageError(), None)


ORPHAN = """
import sys, time
from pathlib import Path
import tests.app.recording.test_process as t
from tests.synthetic_run import write_run
run = write_run(Path(sys.argv[1]) / "here.rrd", frames=40, first_shape=0)
recording = t.opened(Path(sys.argv[1]) / "run.rrd")
t.tell(recording, run)
while not recording._waiting.empty():
    time.sleep(0.01)
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
