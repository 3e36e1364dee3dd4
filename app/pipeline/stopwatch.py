"""How long the stages of a run take."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter

STAGES = ("decode", "track", "reconstruct", "record")


@dataclass
class Stopwatch:
    """Milliseconds per stage: of the current frame, and summed."""

    now: dict[str, float] = field(default_factory=dict)
    total: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Add the duration of the body to a stage."""
        started = perf_counter()
        try:
            yield
        finally:
            elapsed = (perf_counter() - started) * 1e3
            self.now[stage] = self.now.get(stage, 0.0) + elapsed
            self.total[stage] += elapsed
