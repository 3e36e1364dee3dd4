"""Error against the number of modes, for both distances of the paper, clean and with noise (paper's Fig. 3)."""

from itertools import pairwise

from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.lines import FACE, FLAG, Line
from app.reproduce.result import Result, Table, percent
from app.reproduce.work import Effort, Work

LINES = (FLAG, FACE)
METRICS = (("euclidean", "D_E"), ("manhattan", "D_M"))
NOISE = 0.01  # the paper's
NOTABLE = 1.01  # growth of the error that is told


def counts(effort: Effort) -> tuple[int, ...]:
    """Numbers of modes."""
    return (5, 20) if effort.quick else (5, 10, 15, 20, 25, 30)


def mode_counts(work: Work) -> Result:
    """Every number of modes, distance and noise."""
    modes = counts(work.effort)
    panels, rows, remarks = [], [], []
    for line in LINES:
        series, static = [], None
        for color, (metric, symbol) in enumerate(METRICS):
            for noise in (0.0, NOISE):
                errors = [trials(work, line, r, metric, noise) for r in modes]
                static = percent(work.evaluated(line.config(work.data))["e3d_static"])
                name = f"{symbol}, noise {noise:.0%}" if noise else symbol
                series.append(Series(name, modes, errors, color, dashed=bool(noise)))
                means = [mean(several) for several in errors]
                rows.append((line.file.removesuffix(".npz"), symbol, f"{noise:.0%}", *means))
                remarks += [
                    f"{line.name}, {name}: the error rises from {a:.2f} % to {b:.2f} % between r = {m} and {n}."
                    for (m, a), (n, b) in pairwise(zip(modes, means, strict=True))
                    if a is not None and b is not None and b > NOTABLE * a
                ]
        levels = (("rest shape alone", static),) if static is not None else ()
        panels.append(Panel(line.name, "modes r", "e3d, %", series, levels))
    columns = ("data", "distance", "noise", *(f"r = {r}" for r in modes))
    table = Table("e3d in %; with noise the mean over seeds", columns, rows)
    if not remarks:
        remarks = ["Nowhere does the error rise by more than 1 % with more modes."]
    return Result([table], {"mode-counts.png": charts(panels)}, remarks=remarks)


def trials(work: Work, line: Line, modes: int, metric: str, noise: float) -> list[float | None]:
    """Errors of all seeds; without noise they are the same."""
    if not noise:
        e3d = percent(work.evaluated(line.config(work.data, modes=modes, metric=metric))["e3d"])
        return [e3d] * len(work.effort.seeds)
    configs = [line.config(work.data, modes=modes, metric=metric, noise=noise, seed=seed) for seed in work.effort.seeds]
    return [percent(work.evaluated(config)["e3d"]) for config in configs]


def mean(errors: list[float | None]) -> float | None:
    """Of those that are known; None if one is not."""
    known = [error for error in errors if error is not None]
    return sum(known) / len(known) if len(known) == len(errors) else None


def steps(effort: Effort) -> int:
    """Trials."""
    return len(LINES) * len(METRICS) * (len(counts(effort)) * (1 + len(effort.seeds)) + 2)


EXPERIMENT = Experiment(
    "mode-counts",
    "Error against the number of modes",
    mode_counts,
    steps,
    0.6,
    files=(FLAG.file, FACE.file),
    paper="Fig. 3",
)
