"""What a person can choose of `batch`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from app.options.shared import Json
from app.terminal.errors import UsageError


@dataclass(frozen=True)
class Batch(Json):
    """Run many videos, each in a process of its own, into one folder.

    Each gives NAME.rrd and NAME.json, its summary or what went wrong; summary.csv lists all. Videos that are done
    are skipped, those that failed, too, unless --retry is given. Exit code 1 when some failed.

    Examples:
      modeshape batch clips/*.mp4 --jobs 4 --out recordings/clips
      modeshape batch a.mp4 b.mp4 --out both --options="--roi 195 95 325 265 --image none"
      modeshape batch --table clips.csv --out recordings/clips
      modeshape batch /shared/*.mp4 --out /shared/out --scheduler tcp://10.0.0.1:8786
    """

    videos: tyro.conf.Positional[tuple[str, ...]] = ()
    """What `run` takes: video files, image patterns, URLs."""
    table: Path | None = None
    """Videos and their own options: a CSV file with a column `video` and one for each option, as `roi` or `frames`; empty
    cells are left out, `yes` is a switch. Videos are looked for beside the table."""
    out: Path = Path("recordings/batch")
    """The folder."""
    jobs: int | None = None
    """Videos at a time on this machine; without it as many as there are cores."""
    options: str = ""
    """Options of `run` for all of them, quoted, after an equals sign."""
    retry: bool = False
    """Also run again what failed before."""
    scheduler: str | None = None
    """Address of a Dask scheduler (tcp://host:8786) whose workers do it; they need modeshape, and the same files."""

    def __post_init__(self) -> None:
        if not self.videos and self.table is None:
            raise UsageError("batch needs videos: modeshape batch a.mp4 b.mp4, or --table clips.csv")
        if self.jobs is not None and self.jobs < 1:
            raise UsageError(f"--jobs {self.jobs} is too few: give 1 and more")
        if self.jobs is not None and self.scheduler is not None:
            raise UsageError("--jobs is for this machine: with --scheduler, its workers decide")
