"""`modeshape batch`: many videos, on this machine or a cluster; one that fails does not stop the others."""

import csv
import hashlib
import io
import os
import subprocess
import threading
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from rich.box import SIMPLE
from rich.table import Table

from app.commands.batch_job import UNFINISHED, Job, carry_out
from app.files.locks import locked
from app.files.names import stem
from app.files.writing import writable
from app.options.batch import Batch
from app.terminal.arguments import spelled_out, words_of
from app.terminal.errors import UsageError
from app.terminal.exit_code import ExitCode
from app.terminal.progress import Progress
from app.terminal.streams import Tables
from app.terminal.summary import Summary

COLUMNS = (
    "verdict",
    "verdict_reason",
    "frames",
    "points",
    "rest_shape",
    "visible_share",
    "losses",
    "objects",
    "reprojection_rms_px",
    "fps",
)
CONNECT_S = 5.0


@dataclass(frozen=True)
class Outcome(Summary):
    """What came of all videos, those done before included: summary or error, by name."""

    videos: list[dict[str, object]]
    skipped: int
    failed: int
    interrupted: bool

    def print_table(self) -> None:
        """One row per video."""
        before = f", {self.skipped} done before" if self.skipped else ""
        table = Table(title=f"{len(self.videos)} videos{before}", title_justify="left", box=SIMPLE, padding=(0, 1, 0, 0))
        table.add_column("video", overflow="fold", ratio=2)
        for column in ("frames", "seen", "px"):
            table.add_column(column, justify="right", no_wrap=True)
        table.add_column("verdict", overflow="fold", ratio=5)
        for words in self.videos:
            share, error_px = words.get("visible_share"), words.get("reprojection_rms_px")
            told = (
                f"FAILED: {words['error']}"
                if "error" in words
                else f"{words.get('verdict')}: {words.get('verdict_reason')}"
            )
            table.add_row(
                str(words["name"]),
                str(words.get("frames", "")),
                f"{share:.0%}" if isinstance(share, float) else "",
                f"{error_px:.2f}" if isinstance(error_px, float) else "",
                told,
            )
        Tables().print(table)

    @property
    def exit_code(self) -> ExitCode:
        """Whether it was interrupted, or some failed."""
        return ExitCode.INTERRUPTED if self.interrupted else ExitCode.SOME_FAILED if self.failed else ExitCode.DONE


def batch(command: Batch, progress: Progress) -> Outcome:
    """Run the videos that are not done yet, and list all.

    Raises:
        UsageError: the folder cannot be written, another batch writes there, or there is no such scheduler.
    """
    jobs = make_jobs(command)
    with locked(command.out, f"another batch writes to {command.out}: wait for it, or choose another folder with --out"):
        return carried_out(command, jobs, progress)


def carried_out(command: Batch, jobs: list[Job], progress: Progress) -> Outcome:
    """What came of the jobs, in a folder that is ours."""
    results: dict[str, dict[str, object]] = {}
    for job in jobs:
        before = job.done()
        if before is not None and not (command.retry and "error" in before):
            results[job.video] = before
    waiting = [job for job in jobs if job.video not in results]
    skipped, interrupted = len(results), False
    with progress:
        progress.expect(len(waiting))
        try:
            ended = on_cluster(waiting, command.scheduler) if command.scheduler else on_this_machine(waiting, command.jobs)
            for job, words in ended:
                results[job.video] = words
                progress.advance(job.name)
                if "error" in words:
                    progress.log(f"{job.video}: {words['error']}")
        except KeyboardInterrupt:
            interrupted = True
    listed = [{"name": job.name} | results.get(job.video, {"source": job.video, "error": "interrupted"}) for job in jobs]
    failed = [words for words in listed if "error" in words]
    if waiting:
        write_csv(command.out / "summary.csv", listed)
    tidy(command.out / UNFINISHED)
    return Outcome(listed, skipped, len(failed), interrupted)


def make_jobs(command: Batch) -> list[Job]:
    """A job for each video, named after it; by a digest of its path, too, where names are equal.

    Raises:
        UsageError: the folder cannot be made.
    """
    folder = command.out.resolve()
    try:
        (folder / UNFINISHED).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"cannot write to {folder}: {error.strerror}; choose another folder with --out") from error
    options = words_of("--options", command.options)
    own = dict.fromkeys(map(whole, command.videos), ()) | (own_options(command.table) if command.table else {})
    stems = Counter(map(stem, own))
    at_a_time = command.jobs or os.cpu_count() or 1
    cores = 0 if command.scheduler else max(1, (os.cpu_count() or 1) // at_a_time)
    found = []
    for video in own:
        name = stem(video)
        job = Job(video, name, folder, (*options, *own[video]), cores)
        if stems[name] > 1 or (job.report.exists() and job.done() is None):
            digest = hashlib.sha256(os.fsencode("\0".join((video, *job.options)))).hexdigest()[:8]
            job = Job(video, f"{name}-{digest}", folder, job.options, cores)
        found.append(job)
    return found


def whole(video: str) -> str:
    """A video as any process finds it."""
    return video if "://" in video or video.isdigit() else str(Path(video).resolve())


def own_options(path: Path) -> dict[str, tuple[str, ...]]:
    """The videos of a table with their options: a column `video`, and one for each option.

    Raises:
        UsageError: it cannot be read, or has no such column.
    """
    if path.exists() and not path.is_file():
        raise UsageError(f"--table {path} is no file: give a table, as a .csv file")
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"--table {path} cannot be read: {error}") from error
    if not rows or "video" not in rows[0]:
        raise UsageError(f"--table {path} has no column video: begin it with a line like video,roi,frames")
    found: dict[str, tuple[str, ...]] = {}
    for row in rows:
        given = {name: (cell or "").strip() for name, cell in row.items() if name and name != "video"}
        options = [part for name, cell in given.items() if cell for part in option_of(name.strip(), cell)]
        video = (row["video"] or "").strip()
        if not video and any(given.values()):
            raise UsageError(f"--table {path} has a line without a video: {', '.join(filter(None, given.values()))}")
        if not video:
            continue  # spreadsheets write such lines
        found[whole(video if "://" in video else str(path.parent / video))] = tuple(options)
    return found


def option_of(name: str, cell: str) -> list[str]:
    """An option of `run` as it is typed: `roi`, `1 2 3 4` as --roi 1 2 3 4."""
    option = f"--{name.lstrip('-').replace('_', '-')}"
    if cell.lower() in ("yes", "true", "no", "false"):
        return [option if cell.lower() in ("yes", "true") else f"--no-{option[2:]}"]
    return spelled_out([option, cell])


def on_this_machine(jobs: list[Job], at_a_time: int | None) -> Iterator[tuple[Job, dict[str, object]]]:
    """Carry jobs out on this machine, so many at a time; an interrupt ends them all."""
    processes: list[subprocess.Popen[str]] = []
    stopping = threading.Event()

    def guarded(job: Job) -> dict[str, object]:
        if stopping.is_set():
            return {"source": job.video, "error": "interrupted"}
        try:
            return carry_out(job, processes.append)
        except (OSError, ValueError) as error:
            return {"source": job.video, "error": str(error)}

    with ThreadPoolExecutor(at_a_time or os.cpu_count()) as pool:
        futures = {pool.submit(guarded, job): job for job in jobs}
        try:
            for future in as_completed(futures):
                yield futures[future], future.result()
        except BaseException:
            stopping.set()
            for process in processes:
                if process.poll() is None:
                    process.terminate()  # a run keeps what it has
            raise


def on_cluster(jobs: list[Job], scheduler: str) -> Iterator[tuple[Job, dict[str, object]]]:
    """Carry jobs out on the workers of a Dask scheduler.

    Raises:
        UsageError: Dask is not installed, or nobody answers.
    """
    try:
        from distributed import Client
        from distributed import as_completed as ended
    except ImportError:
        raise UsageError("--scheduler needs Dask: pip install 'modeshape[cluster]'") from None
    try:
        client = Client(scheduler, timeout=CONNECT_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise UsageError(f"no Dask scheduler answers at {scheduler}; start one with: dask scheduler") from error
    with client:
        futures = {client.submit(carry_out, job, pure=False): job for job in jobs}
        for future in ended(futures):  # type: ignore[no-untyped-call]
            failure, job = future.exception(), futures[future]
            yield job, {"source": job.video, "error": str(failure)} if failure else future.result()


def write_csv(path: Path, videos: list[dict[str, object]]) -> None:
    """A table of all videos, a row for each."""
    with writable(path) as file, io.TextIOWrapper(file, "utf-8", newline="") as text:
        rows = csv.DictWriter(text, ("name", "source", *COLUMNS, "recording", "error"), extrasaction="ignore")
        rows.writeheader()
        rows.writerows(videos)


def tidy(folder: Path) -> None:
    """Remove a folder that is empty."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()
