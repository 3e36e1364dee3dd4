"""However a run ends, what it has written is there: killed, interrupted, on a full disk."""

import json
import os
import random
import resource
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest

from app.playback.playback import Playback
from tests.app.command_line import ENVIRONMENT, PROGRAM, in_own_process, turning, write_video
from tests.synthetic_run import verify

ARGUMENTS = ("--points", "120", "--rest-shape", "plane", "--bootstrap-frames", "5", "--modes", "6", "--out", "run.rrd")


@pytest.fixture(scope="module")
def endless(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_video(tmp_path_factory.mktemp("endless") / "endless.mp4", list(turning(80)) * 30)


def start(video: Path, folder: Path, *options: str, limit: int | None = None) -> "subprocess.Popen[str]":
    """A run in a process of its own, its files no larger than `limit` bytes."""

    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it, ...
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ... and what nohup began this
        if limit is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.Popen(
        [*PROGRAM, "run", str(video), *ARGUMENTS, "--json", *options],
        cwd=folder,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=prepare,
        start_new_session=True,
    )


def begun(process: "subprocess.Popen[str]", recording: Path) -> None:
    """Wait until there is something in the recording."""
    patience = time.monotonic() + 60
    while not (recording.exists() and recording.stat().st_size > 300_000):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < patience
        time.sleep(0.02)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_a_killed_run_can_be_reviewed(endless: Path, tmp_path: Path, seed: int) -> None:
    process = start(endless, tmp_path)
    begun(process, tmp_path / "run.rrd")
    time.sleep(random.Random(seed).uniform(0.0, 4.0))
    process.kill()
    process.communicate()
    outcome = in_own_process(tmp_path, "review", "run.rrd", "--json")
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["frames"] > 5
    assert words["frames_with_shape"] > 0
    playback = Playback.load(tmp_path / "run.rrd")
    assert playback.summary is None


def test_a_run_is_written_while_it_goes(endless: Path, tmp_path: Path) -> None:
    process = start(endless, tmp_path)
    recording = tmp_path / "run.rrd"
    begun(process, recording)
    sizes, patience = {recording.stat().st_size}, time.monotonic() + 60
    while len(sizes) < 5:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < patience
        sizes.add(recording.stat().st_size)
        time.sleep(0.02)
    process.kill()
    process.communicate()


@pytest.mark.parametrize("signals", [[signal.SIGHUP], [signal.SIGINT] * 6], ids=["hangup", "impatience"])
def test_what_was_asked_for_is_written(endless: Path, tmp_path: Path, signals: list[signal.Signals]) -> None:
    process = start(endless, tmp_path, "--tracks-out", "tracks.npz", "--shapes-out", "shapes.npz")
    begun(process, tmp_path / "run.rrd")
    for number in signals:
        process.send_signal(number)
        time.sleep(0.05)
    err = process.communicate(timeout=120)[1]  # a second signal may come before the summary
    assert process.returncode == 130, err
    assert len(np.load(tmp_path / "tracks.npz")["W"]) == len(np.load(tmp_path / "shapes.npz")["S"]) > 5
    assert len(Playback.load(tmp_path / "run.rrd").frames) > 5
    verify(tmp_path / "run.rrd")


def test_killed_at_once_leaves_nothing_or_a_recording(endless: Path, tmp_path: Path) -> None:
    process = start(endless, tmp_path)
    time.sleep(1.0)
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    left = list(tmp_path.iterdir())
    assert not left or (left == [tmp_path / "run.rrd"] and len(Playback.load(left[0]).frames) > 0)


def test_a_full_disk_is_told_and_earlier_recordings_stay(endless: Path, tmp_path: Path) -> None:
    done = in_own_process(tmp_path, "run", endless, *ARGUMENTS, "--frames", ":10")
    assert done.code == 0, done.err
    earlier = tmp_path / "run.rrd"
    earlier.rename(tmp_path / "earlier.rrd")
    before = (tmp_path / "earlier.rrd").read_bytes()
    process = start(endless, tmp_path, "--jobs", "1", limit=700_000)  # memory that processes share counts as a file
    _, err = process.communicate(timeout=120)
    assert process.returncode == 2, err
    assert "Traceback" not in err
    assert "error: cannot write run.rrd" in err
    assert (tmp_path / "earlier.rrd").read_bytes() == before
    verify(tmp_path / "earlier.rrd")
