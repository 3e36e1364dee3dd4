"""Error against the share of missing entries, and where it breaks."""

from dataclasses import replace

from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.experiments.mode_counts import mean
from app.reproduce.lines import FACE, FLAG, FLAG_PERSPECTIVE, Line
from app.reproduce.published import PAPER_BREAKS_AT, PAPER_E3D, PAPER_MISSING
from app.reproduce.result import Result, Table, percent
from app.reproduce.work import Effort, Trial, Work

LINES = (FLAG, replace(FLAG, name="the same with D_M", metric="manhattan"), FLAG_PERSPECTIVE, FACE)
TOP = 15.0  # %, of the chart
BROKEN = 2.0  # times the error with nothing missing


def shares(effort: Effort) -> tuple[float, ...]:
    """Shares that are hidden."""
    return (0.0, 0.4, 0.8) if effort.quick else tuple(tenth / 10 for tenth in range(10))


def missing(work: Work) -> Result:
    """Every share on every line, over seeds."""
    hidden = shares(work.effort)
    series, rows = [], []
    failures: dict[str, list[str]] = {}  # what, and at which shares, one a seed
    for color, line in enumerate(LINES):
        several = [trials(work, line, share) for share in hidden]
        for share, trials_of_share in zip(hidden, several, strict=True):
            for trial in trials_of_share:
                if trial.failure:
                    failures.setdefault(f"{line.name}: {trial.failure}", []).append(f"{share:.0%}")
        errors = [[percent(trial["e3d"]) for trial in trials_of_share] for trials_of_share in several]
        static = percent(work.evaluated(line.config(work.data))["e3d_static"])
        means = [mean(values) for values in errors]
        series.append(Series(line.name, [100 * share for share in hidden], errors, color))
        rows.append((line.name, *means, static, breaking_point(hidden, errors, static)))
    panel = Panel(
        "Missing entries",
        "hidden, %",
        "e3d, %",
        series,
        points=(("paper, own flag", 100 * PAPER_MISSING, PAPER_E3D),),
        top=TOP,
    )
    columns = ("data", *(f"{share:.0%}" for share in hidden), "rest shape alone", "breaks at")
    table = Table("e3d in %, mean over seeds", columns, rows)
    explained = (
        f"A line breaks at the first share with an error over {BROKEN:.0f} times that with nothing missing, or over that "
        f"of the rest shape alone, in the mean over the seeds, or without a shape. The paper's error does not collapse "
        f"before about {PAPER_BREAKS_AT:.0%}."
    )
    failed = [f"{what} ({', '.join(dict.fromkeys(shares_))} missing)." for what, shares_ in failures.items()]
    return Result([table], {"missing.png": charts([panel])}, remarks=[explained, *failed])


def trials(work: Work, line: Line, share: float) -> list[Trial]:
    """One a seed."""
    configs = [line.config(work.data, missing=share, seed=seed) for seed in work.effort.seeds]
    return [work.evaluated(config) for config in configs]


def breaking_point(hidden: tuple[float, ...], errors: list[list[float | None]], static: float | None) -> str:
    """The first share at which the mean error is no longer of use."""
    first = mean(errors[0])
    if first is None:
        return f"{hidden[0]:.0%}"
    limit = min(BROKEN * first, static or float("inf"))
    for share, several in zip(hidden[1:], errors[1:], strict=True):
        error = mean(several)
        if error is None or error > limit:
            return f"{share:.0%}"
    return f"not up to {hidden[-1]:.0%}"


def steps(effort: Effort) -> int:
    """Trials."""
    return len(LINES) * (len(shares(effort)) * len(effort.seeds) + 1)


EXPERIMENT = Experiment(
    "missing",
    "Missing data",
    missing,
    steps,
    0.6,
    files=(FLAG.file, FLAG_PERSPECTIVE.file, FACE.file),
    paper="§6, missing data",
)
