"""The report: a folder with report.json, report.md, figures/ and footage/; later runs bring it up to date."""

import json
import os
import platform
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy  # type: ignore[import-untyped, unused-ignore]

from app.files.writing import writable
from app.reproduce.experiment import Experiment
from app.reproduce.result import Result, markdown_table
from app.terminal.errors import UsageError

Stored = dict[str, Any]
FIGURES, FOOTAGE = "figures", "footage"


class Report:
    """Results by experiment, on disk after each of them.

    Args:
        folder: where; made if it is not there.
        order: names of all experiments, as they are reported.

    Raises:
        UsageError: the folder holds something else, or cannot be made.
    """

    def __init__(self, folder: Path, order: list[str]) -> None:
        self.folder, self._order = folder, order
        self.experiments: dict[str, Stored] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            if self.json_path.exists():
                self.experiments = json.loads(self.json_path.read_text())["experiments"]
            elif any(folder.iterdir()):
                raise UsageError(f"--out {folder} holds other files: give an empty folder, or one with a report.json")
            for name in (FIGURES, FOOTAGE):
                (folder / name).mkdir(exist_ok=True)
            (folder / FOOTAGE / ".gitignore").write_text(
                "# Pictures of other people's footage are not ours to publish.\n*\n"
            )
        except OSError as error:
            raise UsageError(f"cannot write {folder}: {error.strerror}; choose another --out") from error
        except (ValueError, KeyError, TypeError) as error:
            if isinstance(error, UsageError):
                raise
            raise UsageError(f"{self.json_path} is no report of this program: choose another --out") from None

    @property
    def json_path(self) -> Path:
        """The tables for programs."""
        return self.folder / "report.json"

    @property
    def markdown_path(self) -> Path:
        """The report for people."""
        return self.folder / "report.md"

    def add(self, experiment: Experiment, result: Result, seconds: float, *, quick: bool) -> None:
        """Add one experiment, and write everything."""
        earlier = self.experiments.get(experiment.name, {})
        for folder, pictures in ((FIGURES, result.figures), (FOOTAGE, result.footage)):
            for name in set(earlier.get(folder, [])) - set(pictures):
                (self.folder / folder / name).unlink(missing_ok=True)
            for name, picture in pictures.items():
                with writable(self.folder / folder / name) as file:
                    file.write(picture)
        about = {"title": experiment.title, "paper": experiment.paper, "quick": quick, "seconds": round(seconds, 1)}
        self.experiments[experiment.name] = about | result.as_words()
        self._write(self.json_path, json.dumps(self.as_words(), indent=1, allow_nan=False))
        self._write(self.markdown_path, self.as_markdown())

    def as_words(self) -> Stored:
        """Everything, in order."""
        known = {name: self.experiments[name] for name in self._order if name in self.experiments}
        return {"machine": machine(), "experiments": known}

    def as_markdown(self) -> str:
        """The report for people."""
        here = machine()
        parts = [
            "# The paper's experiments, reproduced\n",
            "Written by `modeshape reproduce`; every number but the published ones is computed by it. Errors are e3d in % "
            "of the true shape's size (see the README), smaller is better.\n",
            f"Times: one thread of {here['cores']}, {here['processor']}, Python {here['python']}, NumPy {here['numpy']}.\n",
        ]
        for stored in self.as_words()["experiments"].values():
            parts += section(stored)
        return "\n".join(parts)

    def headlines(self) -> str:
        """The README's table."""
        rows = [h for stored in self.as_words()["experiments"].values() for h in stored["headlines"]]
        columns = ["data", "setting", "e3d %", "rest shape alone %", "others"]
        return markdown_table(columns, [[h["data"], h["setting"], h["e3d"], h["e3d_static"], h["others"]] for h in rows])

    def table(self, name: str) -> str:
        """The first table of an experiment that is in the report."""
        first = self.experiments[name]["tables"][0]
        return markdown_table(first["columns"], first["rows"])

    def _write(self, path: Path, text: str) -> None:
        with writable(path) as file:
            file.write(text.encode())


def section(stored: Mapping[str, Any]) -> list[str]:
    """An experiment as Markdown."""
    notes = [part for part in (stored["paper"], "quick run: few settings" if stored["quick"] else "") if part]
    parts = [f"## {stored['title']}{' (' + '; '.join(notes) + ')' if notes else ''}\n"]
    for table in stored["tables"]:
        parts += [f"**{table['title']}**\n", markdown_table(table["columns"], table["rows"])]
    if stored["remarks"]:
        parts.append("\n".join(f"- {remark}" for remark in stored["remarks"]) + "\n")
    parts += [f"![{stored['title']}]({FIGURES}/{name})\n" for name in stored["figures"]]
    if stored["footage"]:
        names = ", ".join(f"`{FOOTAGE}/{name}`" for name in stored["footage"])
        parts.append(f"With other people's data in it, so only where the command was run: {names}\n")
    return parts


def machine() -> dict[str, object]:
    """What the times were taken on."""
    return {
        "cores": os.cpu_count(),
        "processor": processor(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


def processor(read: Callable[[], str] = lambda: Path("/proc/cpuinfo").read_text()) -> str:
    """The processor's name where the system tells it."""
    try:
        names = [line.partition(":")[2].strip() for line in read().splitlines() if line.startswith("model name")]
    except OSError:
        names = []
    return names[0] if names else platform.machine()
