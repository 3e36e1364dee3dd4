"""Progress of long work on stderr: phase, frames a second, error and time left."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Task, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

stderr = Console(stderr=True, markup=False, highlight=False)


class FramesPerSecond(TextColumn):
    """Speed of a task in frames a second."""

    def __init__(self) -> None:
        super().__init__("")

    def render(self, task: Task) -> "object":  # type: ignore[override]
        """`31.2 fps`, or nothing before there is a speed."""
        return stderr.render_str(f"{task.speed:.1f} fps" if task.speed else "")


class Progress:
    """A line on stderr while frames are processed; a context manager."""

    def __init__(self, what: str = "starting") -> None:
        self._bars = Bars(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            FramesPerSecond(),
            TextColumn("{task.fields[error]}"),
            TimeRemainingColumn(compact=True),
            console=stderr,
            transient=True,
            disable=not stderr.is_terminal,  # a file gets the lines that stay, and no blank one at the end
        )
        self._task = self._bars.add_task(what, total=None, error="")

    def __enter__(self) -> Self:
        self._bars.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._bars.stop()

    def expect(self, frames: int | None) -> None:
        """Set how many frames are to come, if known."""
        self._bars.update(self._task, total=frames)

    def advance(self, phase: str, error_px: float | None = None) -> None:
        """Count one frame more."""
        error = "" if error_px is None else f"error {error_px:.2f} px"
        self._bars.update(self._task, advance=1, description=phase, error=error)

    def at(self, done: int, total: int) -> None:
        """Set how many are done, and of how many."""
        self._bars.update(self._task, completed=done, total=total)

    def log(self, text: str) -> None:
        """Print a line that stays."""
        stderr.print(text, style="dim", soft_wrap=True)
