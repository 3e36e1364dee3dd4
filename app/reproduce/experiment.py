"""An experiment of the report."""

from collections.abc import Callable
from dataclasses import dataclass

from app.reproduce.result import Result
from app.reproduce.work import Effort, Work


@dataclass(frozen=True)
class Experiment:
    """What is done, with which files, and how long it may take.

    Attributes:
        name: as in --only.
        title: as a heading.
        run: does it.
        steps: their number, for the bar.
        step_s: seconds a step may take, by guess, for the time left.
        files: what is needed of the data folder.
        paper: which part of the paper it repeats.
    """

    name: str
    title: str
    run: Callable[[Work], Result]
    steps: Callable[[Effort], int]
    step_s: float
    files: tuple[str, ...] = ()
    paper: str = ""

    def expected_s(self, effort: Effort) -> float:
        """Seconds it may take."""
        return self.step_s * self.steps(effort)
