"""Every distance between points on every line (the paper's future work)."""

from app.reproduce.experiment import Experiment
from app.reproduce.experiments.accuracy import LINES
from app.reproduce.experiments.basis_time import METRICS
from app.reproduce.lines import FACE, FLAG, FLAG_PERSPECTIVE
from app.reproduce.result import Result, Table, percent
from app.reproduce.work import Effort, Work


def metrics(work: Work) -> Result:
    """One table."""
    errors = [
        [percent(work.evaluated(line.config(work.data, metric=metric))["e3d"]) for metric, _ in METRICS] for line in LINES
    ]
    rows = []
    for line, values in zip(LINES, errors, strict=True):
        known = [(value, name) for value, (_, name) in zip(values, METRICS, strict=True) if value is not None]
        missing = f", {line.missing:.0%} missing" if line.missing else ""
        rows.append((line.name + missing, *values, min(known)[1] if known else None))
    columns = ("data", *(name for _, name in METRICS), "best")
    return Result([Table("e3d in %, for each distance between points", columns, rows)])


def steps(_effort: Effort) -> int:
    """One a line and distance."""
    return len(LINES) * len(METRICS)


EXPERIMENT = Experiment(
    "metrics",
    "Distances between points",
    metrics,
    steps,
    0.6,
    files=(FLAG.file, FLAG_PERSPECTIVE.file, FACE.file),
    paper="future work",
)
