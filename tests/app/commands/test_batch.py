"""Many videos at once: failures isolated and told, restarts, and the same on a cluster of two workers."""

import csv
import json
import os
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from app.commands.batch import make_jobs, own_options
from app.commands.batch_job import Job, own_outputs, reason
from app.options.batch import Batch
from app.terminal.errors import UsageError
from tests.app.command_line import ENVIRONMENT, PROGRAM, Command
from tests.synthetic_run import verify

GOOD = ("a", "b")
OPTIONS = ("--options=--points 100 --image none --frames :12 --modes 5 --no-final-pass",)


@pytest.fixture
def four(videos: Path, here: Path) -> list[Path]:
    """Two videos, one that is none, one that is cut off."""
    folder = here / "clips"
    folder.mkdir()
    for name in GOOD:
        shutil.copy(videos / "turning.mp4", folder / f"{name}.mp4")
    shutil.copy(videos / "text.mp4", folder / "text.mp4")
    whole = (videos / "turning.mp4").read_bytes()
    (folder / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    return sorted(folder.iterdir())


def contents(folder: Path) -> dict[str, tuple[int, bytes]]:
    return {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.iterdir()}


def test_failures_are_named_and_cost_only_themselves(modeshape: Command, four: list[Path]) -> None:
    first = modeshape("batch", *four, "--jobs", 2, "--out", "out", *OPTIONS)
    assert first.code == 1
    assert first.err.count("text.mp4") == 2  # the name, and in the reason
    assert "Traceback" not in first.err
    for name in GOOD:
        verify(Path("out", f"{name}.rrd"))
    assert {path.name for path in Path("out").iterdir()} == {
        *(f"{name}.rrd" for name in GOOD),
        *(f"{path.stem}.json" for path in four),
        "summary.csv",
    }
    with Path("out", "summary.csv").open(newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert [name for name, row in rows.items() if row["error"]] == ["cut", "text"]
    assert all(rows[name]["frames"] == "12" for name in GOOD)

    before = contents(Path("out"))
    second = modeshape("batch", *four, "--out", "out", "--json", *OPTIONS)
    assert second.code == 1
    words = json.loads(second.out)
    assert (words["skipped"], words["failed"], len(words["videos"])) == (4, 2, 4)
    assert contents(Path("out")) == before

    shutil.copy(four[0], four[-1])  # repaired
    third = modeshape("batch", *four, "--out", "out", "--json", "--retry", *OPTIONS)
    assert third.code == 1
    assert json.loads(third.out)["failed"] == 1
    verify(Path("out", "text.rrd"))
    after = contents(Path("out"))
    assert all(after[f"{name}.rrd"] == before[f"{name}.rrd"] for name in GOOD)


@pytest.mark.usefixtures("four")
def test_videos_of_a_table_have_options_of_their_own(modeshape: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    Path("clips", "clips.csv").write_text('video,roi,frames,no_search\na.mp4,"40, 30, 240, 180",:9,yes\nb.mp4,,:6,\n')
    done = modeshape(
        "batch", "--table", "clips/clips.csv", "--jobs", 2, "--out", "out", OPTIONS[0].replace("--frames :12 ", "")
    )
    assert done.code == 0, done.err
    assert max(map(len, done.out.splitlines())) <= 80
    assert done.out.count("fair: ") == 2
    told = {name: json.loads(Path("out", f"{name}.json").read_text()) for name in GOOD}
    assert [told[name]["frames"] for name in GOOD] == [9, 6]
    wrong = modeshape("batch", "--table", "clips/text.mp4", "--out", "out")
    assert wrong.code == 2
    assert "--table clips/text.mp4" in wrong.err


@pytest.mark.slow
def test_two_dask_workers_write_the_same_files(modeshape: Command, four: list[Path]) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install -e '.[cluster]'")
    os.environ.setdefault("PYTHONPATH", str(Path(__file__).parents[3]))
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        outcome = modeshape("batch", *four, "--scheduler", cluster.scheduler_address, "--out", "out", "--json", *OPTIONS)
    assert outcome.code == 1, outcome.err
    words = json.loads(outcome.out)
    assert [one["name"] for one in words["videos"] if "error" in one] == ["cut", "text"]
    for name in GOOD:
        verify(Path("out", f"{name}.rrd"))
    assert {path.suffix for path in Path("out").iterdir()} == {".rrd", ".json", ".csv"}
    assert len(list(Path("out").glob("*.rrd"))) == len(GOOD)


def test_nobody_answers_at_the_scheduler(modeshape: Command, four: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.commands.batch.CONNECT_S", 0.5)
    pytest.importorskip("distributed", reason="Dask is not installed: pip install -e '.[cluster]'")
    outcome = modeshape("batch", *four, "--scheduler", "tcp://127.0.0.1:9", "--out", "out")
    assert outcome.code == 2
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in outcome.err


@pytest.mark.slow
def test_equal_names_get_recordings_of_their_own(modeshape: Command, videos: Path, here: Path) -> None:
    for folder in ("one", "two"):
        (here / folder).mkdir()
        shutil.copy(videos / "turning.mp4", here / folder / "clip.mp4")
    outcome = modeshape("batch", "one/clip.mp4", "two/clip.mp4", "--out", "out", "--json", *OPTIONS)
    assert outcome.code == 0, outcome.err
    assert len(list(Path("out").glob("clip-*.rrd"))) == 2
    assert (
        json.loads(modeshape("batch", "two/clip.mp4", "one/clip.mp4", "--out", "out", "--json", *OPTIONS).out)["skipped"]
        == 2
    )


def test_each_set_of_options_gets_a_recording_of_its_own(modeshape: Command, videos: Path) -> None:
    asked = [("batch", videos / "still.mp4", "--out", "out", "--json", f"--options=--frames :{n}") for n in (8, 9, 10, 9)]
    done = [json.loads(modeshape(*one).out) for one in asked]
    assert [(one["failed"], one["skipped"]) for one in done] == [(0, 0)] * 3 + [(0, 1)]
    assert len(list(Path("out").glob("still*.rrd"))) == 3


def test_somebody_elses_recording_is_left_alone(modeshape: Command, videos: Path, here: Path) -> None:
    (here / "out").mkdir()
    (here / "out" / "turning.rrd").write_text("precious")
    outcome = modeshape("batch", videos / "turning.mp4", "--out", "out", *OPTIONS)
    assert outcome.code == 1
    assert "exists, and is not of this batch" in outcome.err
    assert (here / "out" / "turning.rrd").read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        ((), "needs videos"),
        (("a.mp4", "--jobs", 0), "--jobs 0 is too few"),
        (("a.mp4", "--jobs", 2, "--scheduler", "tcp://x:1"), "--jobs is for this machine"),
    ],
)
def test_mistakes_are_told_in_one_line(modeshape: Command, arguments: tuple[object, ...], what: str) -> None:
    outcome = modeshape("batch", *arguments)
    assert outcome.code == 2
    assert what in outcome.err
    assert outcome.err.count("\n") == 1


def test_an_interrupt_ends_all_and_the_next_call_goes_on(videos: Path, here: Path) -> None:
    command = [
        *PROGRAM,
        "batch",
        str(videos / "turning.mp4"),
        str(videos / "still.mp4"),
        "--jobs",
        "1",
        "--out",
        "out",
        "--json",
    ]
    process = subprocess.Popen(
        command, cwd=here, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    patience = time.monotonic() + 60
    while not (here / "out" / "unfinished" / "turning.rrd").exists():
        assert time.monotonic() < patience
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, err
    assert "Traceback" not in err
    words = json.loads(out)
    assert words["interrupted"] is True
    assert [one["error"] for one in words["videos"]] == ["interrupted", "interrupted"]
    assert not (here / "out" / "turning.json").exists()
    again = subprocess.run([*command, *OPTIONS], cwd=here, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    verify(here / "out" / "turning.rrd")
    verify(here / "out" / "still.rrd")


def test_reports_of_another_video_do_not_count(tmp_path: Path) -> None:
    job = Job("/a/x.mp4", "x", tmp_path)
    job.report.write_text(json.dumps({"source": "/b/x.mp4", "error": "no"}))
    assert job.done() is None
    job.report.write_text(json.dumps({"source": "/a/x.mp4", "options": [], "error": "no"}))
    assert job.done() is not None
    assert replace(job, options=("--points", "100")).done() is None
    job.report.write_text(json.dumps({"source": "/a/x.mp4", "options": [], "frames": 3}))
    assert job.done() is None  # its recording is missing
    job.report.write_text('{"source": "/a/')
    assert job.done() is None


@pytest.mark.parametrize(
    ("code", "err", "words"),
    [
        (2, "progress\nerror: no video file x\n", "no video file x"),
        (-9, "", "killed by signal 9"),
        (1, "Traceback\nKeyError: 3\n", "exit code 1: KeyError: 3"),
        (130, "", "interrupted"),
    ],
)
def test_reasons_are_told_in_one_line(code: int, err: str, words: str) -> None:
    assert reason(code, err) == words


def test_every_job_has_files_of_its_own() -> None:
    options = ("--points", "100", "--shapes-out", "out/s.npz")
    assert own_outputs(options, "clip") == ["--points", "100", "--shapes-out", "out/s-clip.npz"]


def test_lines_of_a_table_without_a_video(tmp_path: Path) -> None:
    table = tmp_path / "clips.csv"
    table.write_text("roi,video\n,a.mp4\n,\n")  # spreadsheets end so
    assert list(own_options(table)) == [str(tmp_path / "a.mp4")]
    table.write_text("roi,video\n1 2 3 4\n")
    with pytest.raises(UsageError, match="a line without a video: 1 2 3 4"):
        own_options(table)


def test_addresses_that_differ_in_what_is_asked_have_names_of_their_own(tmp_path: Path) -> None:
    videos = [f"http://here/watch?v={name}" for name in ("abc", "def")]
    assert len({job.recording for job in make_jobs(Batch(videos, out=tmp_path))}) == 2
