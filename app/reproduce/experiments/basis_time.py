"""How long the basis takes, by distances and by modal analysis, against the number of points (paper's Fig. 4)."""

from collections.abc import Callable
from functools import partial
from time import process_time

from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.experiments.organ import POINTS, organ
from app.reproduce.result import Result, Table
from app.reproduce.work import Effort, Work
from app.rivals.modal_analysis import vibration_modes
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modes import modal_basis
from reconstruction.settings import Metric

MODES = 20
METRICS: tuple[tuple[Metric, str], ...] = (
    ("euclidean", "D_E"),
    ("manhattan", "D_M"),
    ("mahalanobis", "Mahalanobis"),
    ("chi-squared", "chi-squared"),
    ("jensen-shannon", "Jensen-Shannon"),
)
REPEATS, LONG_S = 3, 2.0  # what takes long is not repeated


def point_counts(effort: Effort) -> tuple[int, ...]:
    """Numbers of points."""
    return (100, 200) if effort.quick else (250, 500, 1000, 2000, POINTS)


def basis_time(work: Work) -> Result:
    """Every way on domes of every size."""
    counts = point_counts(work.effort)
    rests = [organ(p).rest for p in counts]
    surfaces = [(rest, triangulate(rest[:2].T)) for rest in rests]
    ways: list[tuple[str, list[float]]] = []
    for metric, name in METRICS:
        ways.append((name, []))
        for rest, mesh in surfaces:
            ways[-1][1].append(least_ms(partial(modal_basis, rest, mesh, MODES, metric)))
            work.step()
    ways.append(("modal analysis", []))
    for rest, mesh in surfaces:
        ways[-1][1].append(least_ms(partial(vibration_modes, rest, mesh.faces, MODES)))
        work.step()
    series = [Series(name, counts, times_ms, color) for color, (name, times_ms) in enumerate(ways)]
    panel = Panel(f"Basis of {MODES} modes", "points", "CPU ms", series, logarithmic=True)
    title = f"CPU ms for {MODES} modes of a dome, one thread, least of {REPEATS}"
    rows = [(name, *times_ms) for name, times_ms in ways]
    for name, times_ms in ways[:2]:
        ratios = (slow / fast for slow, fast in zip(ways[-1][1], times_ms, strict=True))
        rows.append((f"modal analysis / {name}", *ratios))
    table = Table(title, ("way", *(f"{p} points" for p in counts)), rows)
    return Result([table], {"basis-time.png": charts([panel])})


def least_ms(way: Callable[[], object]) -> float:
    """Milliseconds of the processor from the rest shape to its modes: other work on the machine does not count."""
    least = float("inf")
    for _ in range(REPEATS):
        started = process_time()
        way()
        least = min(least, process_time() - started)
        if least > LONG_S:
            break
    return 1e3 * least


def steps(effort: Effort) -> int:
    """One a way and number of points."""
    return (len(METRICS) + 1) * len(point_counts(effort))


EXPERIMENT = Experiment("basis-time", "Run time of the basis", basis_time, steps, 1.5, paper="Fig. 4")
