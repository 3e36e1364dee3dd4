"""`modeshape run` that notes when each frame is done: a process of its own, which prints JSON."""

import json
import sys
from itertools import pairwise
from pathlib import Path
from time import time

import tyro

from app.options.run import Run


def main() -> None:
    """Run with the options on the command line, which are those of `modeshape run` with --out."""
    command = tyro.cli(Run)
    from app.bench.own_process import peak_mb
    from app.pipeline.session import Session
    from app.terminal.progress import Progress

    assert command.output.out is not None
    recording: Path = command.output.out

    class Clock(Progress):
        """Hears of every frame."""

        stamps: list[float] = []  # noqa: RUF012 - one run per process
        grown: dict[int, float] = {}  # noqa: RUF012 - when the recording was first seen with a size

        def advance(self, phase: str, error_px: float | None = None) -> None:
            """One frame more."""
            self.stamps.append(time())
            if recording.exists():
                self.grown.setdefault(recording.stat().st_size, self.stamps[-1])
            super().advance(phase, error_px)

    clock = Clock()
    summary = Session(command, clock).run()
    told = {
        "stamps": clock.stamps,
        "complete": time(),
        "peak_mb": peak_mb(),
        "points": summary.points,
        "unwritten_s": max((b - a for a, b in pairwise(clock.grown.values())), default=0.0),
    }
    sys.stdout.write(json.dumps(told) + "\n")


if __name__ == "__main__":
    main()
