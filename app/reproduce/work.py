"""What an experiment works with: data, settings, progress, and scored trials."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from app.options.evaluate import Evaluate
from app.pipeline.evaluate import evaluate
from app.reproduce.part import Part
from app.terminal.errors import in_a_line
from app.terminal.progress import stderr
from reconstruction import ReconstructionError


@dataclass(frozen=True)
class Effort:
    """How much is tried."""

    quick: bool = False

    @property
    def seeds(self) -> range:
        """Of noise and missing entries."""
        return range(1 if self.quick else 3)


@dataclass(frozen=True)
class Trial:
    """One evaluation: its scores, or why there are none."""

    words: dict[str, object]
    failure: str = ""

    def __getitem__(self, name: str) -> float | None:
        value = self.words.get(name)
        return float(value) if isinstance(value, int | float) else None


class Work:
    """The whole of the experiments; a context manager that shows one bar with the time left.

    Args:
        data: folder with the data.
        scratch: folder for files nobody needs afterwards.
        effort: how much is tried.
        expected_s: seconds that all experiments may take, by guess; only the bar needs them.
    """

    def __init__(self, data: Path, scratch: Path, effort: Effort, expected_s: float) -> None:
        self.data, self.scratch, self.effort = data, scratch, effort
        self._trials: dict[Evaluate, Trial] = {}
        self._bars = Bars(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(compact=True),
            console=stderr,
            transient=True,
            speed_estimate_period=120.0,
            disable=not stderr.is_terminal,
        )
        self._task = self._bars.add_task("starting", total=expected_s)
        self._step_s = 0.0

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._bars.stop()

    @contextmanager
    def experiment(self, title: str, expected_s: float, steps: int) -> Iterator[None]:
        """An experiment of so many steps; at its end the bar is where it was expected to be."""
        before = self._bars.tasks[0].completed
        self._bars.update(self._task, description=title)
        self._step_s = expected_s / steps
        yield
        self._bars.update(self._task, completed=before + expected_s)

    def step(self, share: float = 1.0) -> None:
        """One step is done, or a share of it."""
        self._bars.update(self._task, advance=share * self._step_s)

    def log(self, text: str) -> None:
        """A line that stays."""
        stderr.print(text, style="dim", highlight=False, soft_wrap=True)

    def evaluated(self, config: Evaluate) -> Trial:
        """The scores of `modeshape evaluate`; a step. The same again is not computed again."""
        if config not in self._trials:
            try:
                self._trials[config] = Trial(evaluate(config, Part()).as_dict())
            except ReconstructionError as error:
                self._trials[config] = Trial({}, in_a_line(error))
        self.step()
        return self._trials[config]
