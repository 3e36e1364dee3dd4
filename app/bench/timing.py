"""Timing on a machine that others use, too: least processor time of several repeats, competitors in turn, on one core."""

from collections.abc import Callable, Sequence
from math import log
from time import perf_counter, process_time

MOST_REPEATS = 30

Log = Callable[[str], None]


def least_s(*jobs: Callable[[], object], budget_s: float = 0.3) -> list[float]:
    """Least processor seconds that each job took, run in turn until the budget is spent: 2 to 30 times."""
    least = [float("inf")] * len(jobs)
    started = perf_counter()
    for round_ in range(MOST_REPEATS):
        for i, job in enumerate(jobs):
            begun = process_time()
            job()
            least[i] = min(least[i], process_time() - begun)
        if round_ and perf_counter() - started > budget_s:
            break
    return least


def growth(sizes: Sequence[float], times: Sequence[float]) -> float:
    """How fast time grows with size, from first to last: 1 is linear."""
    return log(times[-1] / times[0]) / log(sizes[-1] / sizes[0])
