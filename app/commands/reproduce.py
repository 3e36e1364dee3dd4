"""`modeshape reproduce`: the experiments one after another, with a report that is complete after each."""

import tempfile
from pathlib import Path
from time import perf_counter

from threadpoolctl import threadpool_limits

from app.files.readme import put_table, with_table
from app.options.reproduce import Reproduce
from app.options.run import Words
from app.reproduce.catalog import CATALOG
from app.reproduce.experiment import Experiment
from app.reproduce.report import Report
from app.reproduce.work import Effort, Work
from app.terminal.errors import UsageError

README_TABLE = "reproduce"


def reproduce(command: Reproduce) -> Words:
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
    if not ready:
        raise UsageError(f"--data {command.data} has none of the files needed: {', '.join(needed(chosen))}")
    expected_s = sum(experiment.expected_s(effort) for experiment in ready)
    interrupted = False
    with (
        tempfile.TemporaryDirectory() as scratch,
        threadpool_limits(1),
        Work(command.data, Path(scratch), effort, expected_s) as work,
    ):
        for name, absent in skipped.items():
            work.say(f"{name}: skipped, {command.data} has no {', '.join(absent)}")
        try:
            for experiment in ready:
                run_one(experiment, work, report)
        except KeyboardInterrupt:
            interrupted = True
    if command.readme and not interrupted:
        put_table(command.readme, README_TABLE, report.headlines())
    return report.as_words() | {"skipped": skipped, "interrupted": interrupted, "report": str(report.markdown_path)}


def run_one(experiment: Experiment, work: Work, report: Report) -> None:
    """One experiment, into the report."""
    started = perf_counter()
    with work.experiment(experiment.title, experiment.expected_s(work.effort), experiment.steps(work.effort)):
        result = experiment.run(work)
    seconds = perf_counter() - started
    report.add(experiment, result, seconds, quick=work.effort.quick)
    work.say(f"{experiment.name}: {seconds:.0f} s")


def needed(experiments: list[Experiment]) -> list[str]:
    """Their files, each once."""
    return list(dict.fromkeys(file for experiment in experiments for file in experiment.files))


def summary(words: Words) -> Words:
    """The outcome for a terminal: the headlines."""
    experiments = words["experiments"]
    assert isinstance(experiments, dict)
    rows: Words = {}
    for stored in experiments.values():
        for headline in stored["headlines"]:
            e3d, static = headline["e3d"], headline["e3d_static"]
            text = "failed" if e3d is None else f"e3d {e3d:.2f} %"
            text += f", rest shape alone {static:.2f} %" if static is not None else ""
            others = f"; {headline['others']}" if headline["others"] else ""
            rows[f"{headline['data']}; {headline['setting']}"] = text + others
    return rows | {"interrupted": words["interrupted"], "report": words["report"]}
