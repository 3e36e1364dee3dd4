"""`modeshape run` that notes when frames are done and what its processes use: a process of its own, which prints JSON."""

import json
import sys
from functools import cache
from itertools import pairwise
from pathlib import Path
from time import time
from typing import TYPE_CHECKING

import tyro

from app.options.run import Run
from app.pipeline.stages.launched import Launched

if TYPE_CHECKING:
    import psutil  # type: ignore[import-untyped]

STAGES = {"tracking_process": "track", "app.recording.process": "record", "stages.maps": "map"}  # by what processes run
EVERY = 20  # frames between two looks at the memory, which take milliseconds


def main() -> None:
    """Run with the options on the command line, which are those of `modeshape run` with --out."""
    command = tyro.cli(Run)
    assert command.output.out is not None
    recording: Path = command.output.out
    with Launched().begin(command) as launched:
        from app.bench.own_process import peak_mb
        from app.pipeline.session import Session
        from app.terminal.progress import Progress

        class Clock(Progress):
            """Hears of every frame."""

            stamps: list[float] = []  # noqa: RUF012 - one run per process
            grown: dict[int, float] = {}  # noqa: RUF012 - when the recording was first seen with a size
            used_s: list[dict[str, float]] = []  # noqa: RUF012 - processor time by stage after each frame
            memory_mb: list[float] = []  # noqa: RUF012 - of all processes

            def advance(self, phase: str, error_px: float | None = None) -> None:
                """One frame more."""
                if phase != "final pass":
                    self.stamps.append(time())
                    self.used_s.append(used_s())
                    if len(self.stamps) % EVERY == 0:
                        self.memory_mb.append(memory_mb())
                    if recording.exists():
                        self.grown.setdefault(recording.stat().st_size, self.stamps[-1])
                super().advance(phase, error_px)

        clock = Clock()
        summary = Session(command, clock, launched=launched).run()
    first, last = clock.used_s[0], clock.used_s[-1]
    told = {
        "stamps": clock.stamps,
        "complete": time(),
        "peak_mb": peak_mb(),
        "memory_mb": max(clock.memory_mb, default=0.0),
        "core_ms": {name: 1e3 * (last[name] - first.get(name, 0.0)) / (len(clock.stamps) - 1) for name in last},
        "latency_ms": summary.latency_ms,
        "points": summary.points,
        "unwritten_s": max((b - a for a, b in pairwise(clock.grown.values())), default=0.0),
    }
    sys.stdout.write(json.dumps(told) + "\n")


def used_s() -> dict[str, float]:
    """Processor time so far of this process, the window's, and of those it has begun."""
    return {stage: sum(process.cpu_times()[:2]) for stage, process in stages().items()}


@cache
def stages() -> "dict[str, psutil.Process]":
    """The processes, by what they do: looked for once, which takes milliseconds."""
    import psutil

    own = psutil.Process()
    return {"reconstruct": own} | {stage_of(process.cmdline()): process for process in own.children()}


def memory_mb() -> float:
    """Memory of all processes; what they share counts once."""
    found = [process.memory_full_info() for process in stages().values()]
    return float(sum(getattr(info, "pss", info.rss) for info in found) / 2**20)


def stage_of(command: list[str]) -> str:
    """What a process does that runs a command."""
    words = " ".join(command)
    return next((stage for module, stage in STAGES.items() if module in words), "other")


if __name__ == "__main__":
    main()
