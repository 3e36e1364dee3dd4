"""`modeshape reproduce`: the experiments one after another, with a report that is complete after each."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from app.files.readme import put_table, with_table
from app.options.reproduce import Reproduce
from app.reproduce.catalog import CATALOG
from app.reproduce.experiment import Experiment
from app.reproduce.report import Report
from app.reproduce.work import Effort, Work
from app.terminal.errors import UsageError
from app.terminal.exit_code import ExitCode
from app.terminal.progress import Progress
from app.terminal.summary import Summary, print_rows

README_TABLE, FOOTAGE_TABLE = "reproduce", "holds-under"  # the second is the name of its experiment, too


@dataclass(frozen=True)
class Reproduced(Summary):
    """The report, and what is not in it: files missing by experiment."""

    machine: Mapping[str, object]
    experiments: Mapping[str, Mapping[str, Any]]
    skipped: Mapping[str, list[str]]
    interrupted: bool
    report: Path

    def print_table(self) -> None:
        """The headlines."""
        headlines = [headline for stored in self.experiments.values() for headline in stored["headlines"]]
        rows = {f"{one['data']}; {one['setting']}": in_words(one) for one in headlines}
        print_rows(rows | {"interrupted": self.interrupted, "report": self.report})

    @property
    def exit_code(self) -> ExitCode:
        """Whether it was interrupted."""
        return ExitCode.INTERRUPTED if self.interrupted else ExitCode.DONE


def reproduce(command: Reproduce, _: Progress) -> Reproduced:
    """Carry out the command.

    Returns:
        the report, with what was skipped and whether it was interrupted.

    Raises:
        UsageError: the folder or the README cannot be used, or no experiment has its data.
    """
    effort = Effort(command.quick)
    if command.readme:
        with_table(command.readme, README_TABLE, "")
    report = Report(command.out, [experiment.name for experiment in CATALOG])
    chosen = [experiment for experiment in CATALOG if not command.only or experiment.name in command.only]
    skipped = {e.name: absent for e in chosen if (absent := [f for f in e.files if not (command.data / f).is_file()])}
    ready = [experiment for experiment in chosen if experiment.name not in skipped]
    if command.readme and any(experiment.name == FOOTAGE_TABLE for experiment in ready):
        with_table(command.readme, FOOTAGE_TABLE, "")
    if not ready:
        raise UsageError(f"--data {command.data} has none of the files needed: {', '.join(needed(chosen))}")
    expected_s = sum(experiment.expected_s(effort) for experiment in ready)
    interrupted = False
    with (
        tempfile.TemporaryDirectory() as scratch,
        Work(command.data, Path(scratch), effort, expected_s) as work,
    ):
        for name, absent in skipped.items():
            work.log(f"{name}: skipped, {command.data} has no {', '.join(absent)}")
        try:
            for experiment in ready:
                run_one(experiment, work, report)
        except KeyboardInterrupt:
            interrupted = True
    if command.readme and not interrupted:
        put_table(command.readme, README_TABLE, report.headlines())
        if any(experiment.name == FOOTAGE_TABLE for experiment in ready):
            put_table(command.readme, FOOTAGE_TABLE, report.table(FOOTAGE_TABLE))
    return Reproduced(**report.as_words(), skipped=skipped, interrupted=interrupted, report=report.markdown_path)


def run_one(experiment: Experiment, work: Work, report: Report) -> None:
    """One experiment, into the report."""
    started = perf_counter()
    with work.experiment(experiment.title, experiment.expected_s(work.effort), experiment.steps(work.effort)):
        result = experiment.run(work)
    seconds = perf_counter() - started
    report.add(experiment, result, seconds, quick=work.effort.quick)
    work.log(f"{experiment.name}: {seconds:.0f} s")


def needed(experiments: list[Experiment]) -> list[str]:
    """Their files, each once."""
    return list(dict.fromkeys(file for experiment in experiments for file in experiment.files))


def in_words(headline: Mapping[str, Any]) -> str:
    """An experiment's most important figures in a line."""
    e3d, static = headline["e3d"], headline["e3d_static"]
    text = "failed" if e3d is None else f"e3d {e3d:.2f} %"
    text += f", rest shape alone {static:.2f} %" if static is not None else ""
    return text + (f"; {headline['others']}" if headline["others"] else "")
