"""What a person can choose of `reproduce`; nothing heavy is imported here, so that `--help` is instant."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from app.options.shared import Json
from app.terminal.errors import UsageError

Name = Literal[
    "accuracy",
    "peers",
    "mode-counts",
    "metrics",
    "missing",
    "basis-time",
    "mode-shapes",
    "organ",
    "sample",
    "paper",
    "talking-face",
    "hard-cases",
    "holds-under",
]
NAMES: tuple[str, ...] = get_args(Name)


@dataclass(frozen=True)
class Reproduce(Json):
    """Repeat the paper's experiments: figures and tables (Markdown, JSON), each beside what others published.

    OUT/report.md and report.json hold the tables, OUT/figures the figures, OUT/footage pictures that show other
    people's footage. Experiments whose data are missing are skipped; an earlier report in OUT is brought up to date.

    Examples:
      modeshape reproduce --data ../shared/data --out docs/reproduced --readme README.md
      modeshape reproduce --data ../shared/data --out /tmp/look --only missing organ --quick
    """

    data: Path
    """Folder with flag250.npz, flag250_perspective.npz, face37.npz, kinect_paper.mp4 and talking_face.mp4."""
    out: Path
    """Folder for the report."""
    only: Annotated[tuple[Name, ...], tyro.conf.arg(metavar="NAME…")] = ()
    """Experiments to run, of: accuracy, peers, mode-counts, metrics, missing, basis-time, mode-shapes, organ, sample,
    paper, talking-face, hard-cases, holds-under; without it all."""
    quick: bool = False
    """Fewer settings, one seed, fewer frames: for a first look."""
    readme: Path | None = None
    """File whose tables between marker comments are replaced: the report's headlines, and what footage it holds under."""

    def __post_init__(self) -> None:
        if not self.data.is_dir():
            raise UsageError(f"--data {self.data} is no folder: give the one with flag250.npz and the others")
        if self.out.exists() and not self.out.is_dir():
            raise UsageError(f"--out {self.out} is a file: give a folder")
