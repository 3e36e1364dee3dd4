"""`modeshape bench`: everything measured one after another, with ratios that have targets."""

import os
import platform
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.util import find_spec

from rich.table import Table

from app.bench import basis, end_to_end, painting, window
from app.bench.targets import Ratios, markdown, rows
from app.files.readme import put_table, with_table
from app.files.writing import check_free, writable
from app.options.bench import Bench
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from app.terminal.streams import Tables
from app.terminal.summary import Summary

Row = dict[str, object]

README_TABLE = "bench"
MOST_COLUMNS = 10  # of a table in a terminal


@dataclass(frozen=True)
class Benchmarks(Summary):
    """Everything that was measured; rows of the tables as dictionaries."""

    machine: Mapping[str, str | int | None]
    quick: bool
    ratios: Ratios
    missed: list[str]
    window: list[Row]
    rivals: list[Row]
    basis: list[Row]
    runs: list[Row]
    ceres: bool

    def print_table(self) -> None:
        """The tables, and the ratios beside their targets."""
        console = Tables()
        tables = {"Window step": self.window, "Rivals": self.rivals, "Basis": self.basis, "Whole runs": self.runs}
        for title, measured in tables.items():
            console.print(as_table(title, measured))
        console.print(with_targets(self.ratios))
        if not self.ceres:
            console.print("Ceres took no part: pyceres is not installed; pip install 'modeshape[bench]'")


def bench(command: Bench, progress: Progress) -> Benchmarks:
    """Measure; with `--plot` and `--readme`, write.

    Raises:
        UsageError: psutil is missing, a file cannot be written, or the README has no place for the table.
    """
    if find_spec("psutil") is None:
        raise UsageError("bench reads what processes use with psutil: pip install 'modeshape[bench]'")
    check_free(command.plot, overwrite=command.overwrite)
    if command.readme:
        with_table(command.readme, README_TABLE, "")
    quick, log = command.quick, progress.log
    with progress:
        races = list(window.races(quick=quick, log=log))
        if races[0].ceres_ms is None:
            log("pyceres is not installed, so Ceres takes no part: pip install 'modeshape[bench]'")
        timings = window.timings(quick=quick, log=log)
        basis_times = list(basis.basis_times(quick=quick, log=log))
        angles = {metric: basis.angle_degrees(metric, log) for metric in basis.METRICS}
        runs = list(end_to_end.whole_runs(quick=quick, log=log))
        help_s = end_to_end.help_s(log)
        paint_ms = painting.paint_ms(log)
        many = None if quick else end_to_end.many_points(log)
    ratios = window.ratios(timings, races) | basis.ratios(basis_times, angles)
    ratios |= end_to_end.ratios(runs, help_s, many) | {"paint_ms": paint_ms}
    if command.plot:
        from app.bench.plot import draw

        with writable(command.plot) as file:
            draw(file, command.plot.suffix[1:], timings, races, basis_times)
    if command.readme:
        put_table(command.readme, README_TABLE, markdown(ratios, in_words(machine())))
    return Benchmarks(
        machine=machine(),
        quick=quick,
        ratios=ratios,
        missed=[what for what, _, _, met in rows(ratios) if not met],
        window=[asdict(timing) for timing in timings],
        rivals=[asdict(race) for race in races],
        basis=[asdict(time) for time in basis_times],
        runs=[asdict(run) for run in runs],
        ceres=races[0].ceres_ms is not None,
    )


def machine() -> dict[str, str | int | None]:
    """What was measured on."""
    return {"processor": platform.machine(), "cores": os.cpu_count(), "python": platform.python_version()}


def in_words(facts: dict[str, str | int | None]) -> str:
    """The machine in a line."""
    return f"{facts['cores']} cores ({facts['processor']}), Python {facts['python']}; window step and basis on one core."


def as_table(title: str, measured: list[Row]) -> Table:
    """A row for each of what was measured; if it has more figures than fit into a line, a column."""
    each = [flat(row) for row in measured]
    names = list(dict.fromkeys(name for row in each for name in row))
    cells = [[name.replace("_", " ") for name in names], *([in_short(row.get(name)) for name in names] for row in each)]
    if len(names) > MOST_COLUMNS:
        cells = [["", *map(str, range(1, len(each) + 1))], *map(list, zip(*cells, strict=True))]
    table = Table(*cells[0], title=title, title_justify="left")
    for column in table.columns:
        column.justify, column.overflow = "right", "fold"
    for row in cells[1:]:
        table.add_row(*row)
    return table


def flat(row: Row) -> Row:
    """Each figure under a name of its own, where several had one together."""
    figures: Row = {}
    for name, value in row.items():
        figures |= {f"{name} {key}": one for key, one in value.items()} if isinstance(value, dict) else {name: value}
    return figures


def in_short(value: object) -> str:
    """A figure in a table."""
    return f"{value:.4g}" if isinstance(value, float) else "–" if value is None else str(value)


def with_targets(ratios: Ratios) -> Table:
    """Figures beside what they should be."""
    table = Table("measured", "figure", "target", "", title="Targets", title_justify="left")
    for what, value, wanted, met in rows(ratios):
        table.add_row(what, value, wanted, "" if met else "missed")
    return table
