"""Work in a process of its own, whose largest memory is then known."""

import resource
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

STATUS = Path("/proc/self/status")


def apart(work: Callable[..., T], *args: object) -> tuple[T, float]:
    """What the work gives, and the most memory in MB that its process ever had."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(_watched, work, *args).result()


def _watched(work: Callable[..., T], *args: object) -> tuple[T, float]:
    return work(*args), peak_mb()


def peak_mb() -> float:
    """The most memory in MB that this process ever had."""
    if STATUS.exists():  # what resource says counts the parent of a fork, too
        line = next(line for line in STATUS.read_text().splitlines() if line.startswith("VmHWM"))
        return int(line.split()[1]) / 1024
    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
