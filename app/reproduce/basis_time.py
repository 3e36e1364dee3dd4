"""How long the basis takes, for both distances of the paper, against the number of points (paper's Fig. 4)."""

from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.organ import POINTS, organ
from app.reproduce.result import Result, Table
from app.reproduce.work import Effort, Work
from reconstruction.mesh import triangulate
from reconstruction.modes import Metric, modal_basis

MODES = 20
METRICS: tuple[tuple[Metric, str], ...] = (
    ("euclidean", "D_E"),
    ("manhattan", "D_M"),
    ("mahalanobis", "Mahalanobis"),
    ("chi-squared", "chi-squared"),
    ("jensen-shannon", "Jensen-Shannon"),
)
REPEATS = 3


def point_counts(effort: Effort) -> tuple[int, ...]:
    """Numbers of points."""
    return (100, 200) if effort.quick else (250, 500, 1000, 2000, POINTS)


def basis_time(work: Work) -> Result:
    """Least time of some repeats."""
    counts = point_counts(work.effort)
    series, rows = [], []
    for color, (metric, name) in enumerate(METRICS):
        times_ms = []
        for p in counts:
            times_ms.append(least_ms(metric, p))
            work.step()
        series.append(Series(name, counts, times_ms, color))
        rows.append((name, *times_ms))
    panel = Panel(f"Basis of {MODES} modes", "points", "ms", series, logarithmic=True)
    table = Table(
        f"ms for {MODES} modes, one thread, least of {REPEATS}", ("distance", *(f"{p} points" for p in counts)), rows
    )
    return Result([table], {"basis-time.png": charts([panel])})


def least_ms(metric: Metric, points: int) -> float:
    """Milliseconds from the rest shape to its modes."""
    rest = organ(points).rest
    mesh = triangulate(rest[:2].T)
    times = []
    with threadpool_limits(1):
        for _ in range(REPEATS):
            started = perf_counter()
            modal_basis(rest, mesh, MODES, metric)
            times.append(perf_counter() - started)
    return float(1e3 * np.min(times))


def steps(effort: Effort) -> int:
    """One a distance and number of points."""
    return len(METRICS) * len(point_counts(effort))


EXPERIMENT = Experiment("basis-time", "Run time of the basis", basis_time, steps, 1.5, paper="Fig. 4")
