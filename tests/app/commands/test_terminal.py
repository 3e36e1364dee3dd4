"""Where output goes, what files are called, and mistakes nobody thought of: never a traceback."""

import shutil
import subprocess
from pathlib import Path

import pytest

from app.options.review import Review
from tests.app.command_line import ENVIRONMENT, PROGRAM, Command
from tests.synthetic_run import Run

LONG = "x" * 300


@pytest.fixture
def recording(run: Run, here: Path) -> Path:
    return Path(shutil.copy(run.path, here / "paper [red] [bold].rrd"))


@pytest.mark.parametrize(
    ("redirected", "code", "words"),
    [
        (">&- 2>&-", 0, ""),
        ("--json > /dev/full", 2, "error: the output cannot be written: No space left on device"),
        ("| true", 0, ""),
        ("2> /dev/full", 0, "modeshape review"),
    ],
)
def test_nobody_listens(recording: Path, redirected: str, code: int, words: str) -> None:
    line = f"set -o pipefail; '{PROGRAM[0]}' -m modeshape review '{recording}' {redirected}"
    done = subprocess.run(["bash", "-c", line], env=ENVIRONMENT, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert (done.stdout + done.stderr).lstrip().startswith(words)
    assert "Traceback" not in done.stderr


def test_a_terminal_of_few_letters(recording: Path) -> None:
    environment = ENVIRONMENT | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run([*PROGRAM, "review", recording], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "verdict" in done.stdout or "recording" in done.stdout


def test_names_are_shown_as_they_are(modeshape: Command, recording: Path) -> None:
    outcome = modeshape("review", recording.name)
    assert outcome.code == 0, outcome.err
    assert "paper [red] [bold].rrd" in outcome.out
    outcome = modeshape("export", recording.name, "--format", "npz")
    assert outcome.code == 0, outcome.err
    assert "paper [red] [bold].npz" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "v\udcff.mp4"], "v?.mp4 is not UTF-8"),
        (["review", f"{LONG}.rrd"], "File name too long"),
        (["run", f"{LONG}.mp4"], "File name too long"),
        (["run", "v.mp4", "--out", f"{LONG}.rrd"], "File name too long"),
        (["evaluate", "t.npz", "--shapes-out", f"{LONG}.npz"], "File name too long"),
        (["batch", "v.mp4", "--options=--points '60"], "close the quotes"),
    ],
    ids=lambda value: " ".join(value)[:30] if isinstance(value, list) else "",
)
def test_odd_names_are_refused(modeshape: Command, arguments: list[str], words: str) -> None:
    outcome = modeshape(*arguments)
    assert outcome.code == 2
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1
    assert words in outcome.err


def test_a_mistake_of_ours_is_a_line_and_a_file(modeshape: Command, monkeypatch: pytest.MonkeyPatch, here: Path) -> None:
    def broken(_command: Review, _progress: object) -> None:
        raise IndexError("index 3 is out of\nbounds")

    monkeypatch.setattr("app.commands.review.review", broken)
    monkeypatch.setattr("tempfile.tempdir", str(here))
    outcome = modeshape("review", "a.rrd")
    assert outcome.code == 70
    assert outcome.err.startswith("error: IndexError: index 3 is out of bounds; where it happened is in ")
    assert outcome.err.count("\n") == 1
    assert "in broken" in Path(outcome.err.split()[-1]).read_text()
    assert "in broken" in modeshape("review", "a.rrd", "--verbose").err
