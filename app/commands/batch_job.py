"""One video of a batch, in a process of its own."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.files.names import beside
from app.files.writing import write_json
from app.terminal.exit_code import ExitCode

UNFINISHED = "unfinished"
OUTPUTS = ("--tracks-out", "--shapes-out")


@dataclass(frozen=True)
class Job:
    """One video and where its results go.

    Attributes:
        video: what `run` takes; absolute if it is a file.
        name: of the recording, unique in the folder.
        folder: absolute; holds NAME.rrd and NAME.json when it is done, and meanwhile unfinished/NAME.rrd.
        options: of `run`.
        cores: that it may use; 0 for all.
    """

    video: str
    name: str
    folder: Path
    options: tuple[str, ...] = ()
    cores: int = 0

    @property
    def recording(self) -> Path:
        """The recording, once it is done."""
        return self.folder / f"{self.name}.rrd"

    @property
    def report(self) -> Path:
        """The file with its summary, or with what went wrong."""
        return self.folder / f"{self.name}.json"

    def done(self) -> dict[str, object] | None:
        """The report of an earlier batch on the same video; None if there is none."""
        try:
            words = json.loads(self.report.read_text())
        except (OSError, ValueError):
            return None
        mine = isinstance(words, dict) and words.get("source") == self.video and words.get("options") == list(self.options)
        return words if mine and ("error" in words or self.recording.exists()) else None


def carry_out(job: Job, started: Callable[["subprocess.Popen[str]"], None] = lambda _: None) -> dict[str, object]:
    """Run the video in another process; returns its summary, or source and error.

    What was asked for and cannot be done is remembered; what ended otherwise is tried again by the next batch.
    """
    unfinished = job.folder / UNFINISHED / f"{job.name}.rrd"
    if job.recording.exists():
        return {"source": job.video, "error": f"{job.recording} exists, and is not of this batch: move it away"}
    unfinished.parent.mkdir(parents=True, exist_ok=True)
    arguments = ["run", job.video, *own_outputs(job.options, job.name), "--out", str(unfinished), "--overwrite", "--json"]
    environment = dict(os.environ)
    if job.cores:
        environment["OPENCV_FOR_THREADS_NUM"] = str(job.cores)
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "modeshape", *arguments],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,  # Ctrl-C is for the batch, which then ends its processes
    )
    started(process)
    out, err = process.communicate()
    if process.returncode != 0:
        error = reason(process.returncode, err)
        if process.returncode == ExitCode.BAD_INPUT:
            unfinished.unlink(missing_ok=True)
            write_json(job.report, {"source": job.video, "options": list(job.options), "error": error})
        return {"source": job.video, "error": error}
    words: dict[str, object] = json.loads(out)
    unfinished.replace(job.recording)
    words |= {"source": job.video, "options": list(job.options), "recording": str(job.recording)}
    for number in range(2, int(str(words.get("parts", 1))) + 1):
        part = unfinished.with_name(f"{job.name}-part{number}.rrd").replace(job.folder / f"{job.name}-part{number}.rrd")
        words["last_part"] = str(part)
    write_json(job.report, words)
    return words


def own_outputs(options: Sequence[str], name: str) -> list[str]:
    """Options in which each file that is written has the job's name in its own: s.npz becomes s-NAME.npz."""
    own = list(options)
    for i in range(1, len(own)):
        if own[i - 1] in OUTPUTS:
            own[i] = str(beside(Path(own[i]), name, overwrite=True))
    return own


def reason(code: int, err: str) -> str:
    """Why a run ended, in one line."""
    lines = [line for line in err.splitlines() if line.strip()]
    last = lines[-1] if lines else ""
    if code == ExitCode.BAD_INPUT:
        return last.removeprefix("error: ")
    if code == ExitCode.INTERRUPTED:
        return "interrupted"
    return f"killed by signal {-code}" if code < 0 else f"exit code {code}: {last}"
