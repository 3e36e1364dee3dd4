"""How long the stages of a run take."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import monotonic, perf_counter

import numpy as np

from app.recording.entities import STAGES


@dataclass
class Stopwatch:
    """Milliseconds per stage: of the current frame, and summed; and seconds of the whole."""

    now: dict[str, float] = field(default_factory=dict)
    total: dict[str, float] = field(default_factory=lambda: dict.fromkeys(STAGES, 0.0))

    _latencies_ms: list[float] = field(default_factory=list)
    _started_s: float = 0.0
    _elapsed_s: float | None = None

    def start(self) -> None:
        """The whole begins."""
        self._started_s = perf_counter()

    def stop(self) -> None:
        """The whole is over."""
        self._elapsed_s = self.elapsed_s

    @property
    def elapsed_s(self) -> float:
        """Seconds from start to stop, or until now."""
        return perf_counter() - self._started_s if self._elapsed_s is None else self._elapsed_s

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Add the duration of the body to a stage."""
        started = perf_counter()
        try:
            yield
        finally:
            self.add({stage: (perf_counter() - started) * 1e3})

    def arrived(self, read_s: float) -> None:
        """The mesh of a frame is there, which was read at that time, as `time.monotonic` tells it."""
        self._latencies_ms.append(1e3 * (monotonic() - read_s))

    @property
    def latency_ms(self) -> dict[str, float] | None:
        """From frame to mesh: median, 95th percentile and worst; None without a mesh."""
        if not self._latencies_ms:
            return None
        median, p95, worst = np.percentile(self._latencies_ms, [50, 95, 100]).tolist()
        return {"median": median, "p95": p95, "worst": worst}

    def add(self, stage_ms: Mapping[str, float]) -> None:
        """Add what stages took elsewhere."""
        for stage, milliseconds in stage_ms.items():
            self.now[stage] = self.now.get(stage, 0.0) + milliseconds
            self.total[stage] += milliseconds
