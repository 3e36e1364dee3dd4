"""By hand: does a long run stay small and quick?  python -m tests.robustness.long_run [VIDEO]

Runs the talking face twice through (9,600 frames), records it, and fails if resident memory grows by more than 10 MB
between frame 1,000 and the last, or if the last thousand frames take 1.2 times the processor time of the second.
"""

import gc
import sys
import tempfile
from pathlib import Path
from time import process_time

import cv2
import numpy as np

from app.options.run import Output, Run
from app.pipeline.session import Session
from app.terminal.progress import Progress
from tests.robustness.degraded import changed

FACE = Path(__file__).parents[2].parent / "shared" / "data" / "talking_face.mp4"
ROI = (115, 70, 130, 160)
WARM, GROWTH_MB, SLOWER = 1000, 10.0, 1.2


class Watcher(Progress):
    """Notes memory and time at every frame."""

    def __init__(self) -> None:
        super().__init__()
        self.resident_mb: list[float] = []
        self.at_s: list[float] = []

    def advance(self, phase: str, error_px: float | None = None) -> None:
        super().advance(phase, error_px)
        self.resident_mb.append(resident_mb())
        self.at_s.append(process_time())
        if len(self.at_s) % 500 == 0:
            sys.stderr.write(f"frame {len(self.at_s)}: {self.resident_mb[-1]:.1f} MB, {phase}\n")


def resident_mb() -> float:
    """Resident memory of this process and of the one that writes the recording."""
    children = [pid for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()]
    pages = [int(Path(f"/proc/{pid}/statm").read_text().split()[1]) for pid in ("self", *children)]
    return sum(pages) * 4096 / 2**20


def twice(video: Path, path: Path) -> Path:
    """A video that shows another one twice."""
    writer = None
    for _ in range(2):
        for image in changed(video, lambda _, picture: picture):
            size = image.shape[1::-1]
            writer = writer or cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 25.0, size)
            writer.write(image)
    assert writer is not None
    writer.release()
    return path


def main(video: Path = FACE) -> int:
    """Exit code: 0 when it stays small and quick."""
    with tempfile.TemporaryDirectory() as folder:
        source = twice(video, Path(folder, "twice.mp4"))
        gc.collect()
        watcher = Watcher()
        run = Run(source=str(source), roi=ROI, output=Output(out=Path(folder, "run.rrd")))
        summary = Session(run, watcher).run()
    memory, step = np.array(watcher.resident_mb), np.diff(watcher.at_s) * 1e3
    grown = float(np.median(memory[-100:]) - np.median(memory[WARM : WARM + 100]))
    early, late = float(np.median(step[WARM : 2 * WARM])), float(np.median(step[-WARM:]))
    sys.stdout.write(
        f"{len(memory)} frames, {summary.losses} losses; memory at frame {WARM}: {memory[WARM]:.1f} MB, "
        f"at the end {memory[-1]:.1f} MB, grown {grown:.1f} MB; "
        f"median processor time per frame {early:.1f} ms, at the end {late:.1f} ms\n"
    )
    return int(grown > GROWTH_MB or late > SLOWER * early)


if __name__ == "__main__":
    sys.exit(main(*map(Path, sys.argv[1:])))
