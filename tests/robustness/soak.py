"""By hand: does a long run stay small and quick?  python -m tests.robustness.soak face|cuts|objects [COUNT]

face: the talking face forward and back, 20,000 frames; cuts: 50 cuts from one stretch of it to another; objects: 20 sheets,
one after another, and the first again. Each is run and recorded. It is bad when all processes take 5 % more memory later
than after frame 1,000 (of objects, 10 MB for each), when a frame of the last thousand takes 1.2 times the processor time of
one of the second thousand, when the process that records takes more than 300 MB, when a recording cannot be read, or when
the face's verdict is another than after its first 1,000 frames.
"""

import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import chain, islice
from pathlib import Path
from threading import Event, Thread

import cv2
import numpy as np
from numpy.typing import NDArray

from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.terminal.progress import Progress
from tests.app.command_line import turning
from tracking.video import Video

Image = NDArray[np.uint8]

FACE = Path(__file__).parents[2].parent / "shared" / "data" / "talking_face.mp4"
ROI = (115, 70, 130, 160)
WARM, CHANGED, OBJECT_MB, SLOWER, COMPLETING_MB = 1000, 0.05, 10.0, 1.2, 300.0
STRETCH, SHEET = 100, 200  # frames from cut to cut, and of each sheet: another is looked for after 2 s, needs a model


def to_and_fro() -> Iterator[Image]:
    """The face, forward and back for ever."""
    with tempfile.TemporaryDirectory() as folder:
        frames = 0
        with Video(str(FACE)) as video:
            for frame in video:
                cv2.imwrite(f"{folder}/{frames}.jpg", frame.image, [cv2.IMWRITE_JPEG_QUALITY, 95])
                frames += 1
        while True:
            for number in chain(range(frames), range(frames - 1, -1, -1)):
                yield cv2.imread(f"{folder}/{number}.jpg")  # type: ignore[misc]


def cuts(count: int) -> Iterator[Image]:
    """So many stretches of the face, each from somewhere else."""
    rng = np.random.default_rng(0)
    for begin in rng.integers(0, 4000, count + 1):
        with Video(str(FACE), int(begin), int(begin) + STRETCH) as video:
            yield from (frame.image for frame in video)


def sheets(count: int) -> Iterator[Image]:
    """So many sheets that fill the picture, one after another, and the first again."""
    for seed in [*range(count), 0]:
        yield from turning(SHEET, seed=seed, scale=1.2)


class Memory(Thread):
    """Resident memory of this process and of all that it has begun, five times a second.

    Attributes:
        at_s, each_mb: when, and each by its module.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.at_s, self.each_mb = list[float](), list[dict[str, float]]()
        self._end = Event()

    def run(self) -> None:
        while not self._end.wait(0.2):
            self.each_mb.append(dict(resident_mb()))
            self.at_s.append(time.monotonic())

    def end(self) -> None:
        """Measure no more."""
        self._end.set()
        self.join()


def resident_mb() -> Iterator[tuple[str, float]]:
    """Module and memory of this process, and of each that it has begun."""
    children = [pid for task in Path("/proc/self/task").iterdir() for pid in (task / "children").read_text().split()]
    for pid in ("self", *children):
        try:
            words = Path(f"/proc/{pid}/cmdline").read_text().split("\0")
            module = next((word for word in words if word.startswith("app.")), "the run")
            yield f"{module} {pid}", int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * 4096 / 2**20
        except OSError:  # it has just ended
            continue


class Watcher(Progress):
    """Notes the times of every frame."""

    def __init__(self) -> None:
        super().__init__()
        self.at_s, self.worked_s = list[float](), list[float]()

    def advance(self, phase: str, error_px: float | None = None) -> None:
        super().advance(phase, error_px)
        if phase == "final pass":
            return
        self.at_s.append(time.monotonic())
        self.worked_s.append(time.process_time())


def soak(kind: str, count: int) -> list[str]:
    """Run one kind; what was measured and what is bad, a line each."""
    pictures: Callable[[], Iterator[Image]] = {
        "face": lambda: islice(to_and_fro(), count), "cuts": lambda: cuts(count), "objects": lambda: sheets(count)
    }[kind]  # fmt: skip
    with tempfile.TemporaryDirectory() as name:
        video, out = Path(name, "film.mp4"), Path(name, "run.rrd")
        write(video, pictures())
        region = None if kind == "objects" else ROI
        short = verdict(video, region, Path(name, "short.rrd")) if kind == "face" else None
        watcher, memory = Watcher(), Memory()
        memory.start()
        session = Session(Run(source=str(video), roi=region, output=Output(out=out)), watcher)
        words = session.run().as_dict()
        memory.end()
        video_mb, files_mb = (sum(p.stat().st_size for p in Path(name).glob(f"*{end}")) / 2**20 for end in (".mp4", ".rrd"))
        frames = [len(Playback.load(path).frames) for path in session.recordings]
    at_s = np.array(memory.at_s)
    mb = {name: np.array([now.get(name, 0.0) for now in memory.each_mb]) for name in memory.each_mb[len(at_s) // 2]}
    total_mb = np.sum(list(mb.values()), axis=0)
    warm, last = watcher.at_s[min(WARM, len(watcher.at_s) // 4)], watcher.at_s[-1]
    early_on, later = (at_s > warm) & (at_s < warm + 10), (at_s > warm) & (at_s < last)
    before, during = float(np.median(total_mb[early_on])), total_mb[later]  # maps take more now and then
    after = float(np.median(total_mb[(at_s > last - 10) & (at_s < last)]))
    step = np.diff(watcher.worked_s) * 1e3
    part = min(WARM, len(step) // 3)
    early, late = (float(np.median(step[one])) for one in (slice(part, 2 * part), slice(-part, None)))
    recorder = max(float(one.max()) for name, one in mb.items() if "recording" in name)
    allowed = CHANGED * before if kind != "objects" else OBJECT_MB * count
    told = {name: words[name] for name in ("frames", "objects", "losses", "recoveries", "fps", "verdict", "verdict_reason")}
    lines = [
        json.dumps(told),
        f"{sum(frames)} frames in {len(frames)} recordings of {files_mb:.0f} MB (the video: {video_mb:.0f} MB)",
        f"all processes: {before:.0f} MB, at last {after:.0f} MB, between {during.min():.0f} and {during.max():.0f} MB; "
        f"after the last frame at most {total_mb[at_s > last].max(initial=0.0):.0f} MB",
        *(
            f"{name}: {np.median(one[early_on]):.0f}, at last {one[later][-1]:.0f}, {one.max():.0f} MB"
            for name, one in mb.items()
        ),
        f"processor time of a frame in the run's own process: {early:.2f} ms, at the end {late:.2f} ms",
    ]
    complaints = {
        "memory grows": after > before + allowed,
        "slower": kind != "objects" and late > SLOWER * early,
        "recording takes too much memory": recorder > COMPLETING_MB,
        "frames are missing": sum(frames) != words["frames"],
        f"the verdict was {short}": short is not None and words["verdict"] != short,
        "objects": kind == "objects" and (words["objects"], words["recoveries"]) != (count, 1),
    }
    return lines + [f"BAD: {complaint}" for complaint, is_bad in complaints.items() if is_bad]


def verdict(video: Path, region: tuple[int, int, int, int] | None, out: Path) -> object:
    """Of the first frames."""
    config = Run(source=str(video), roi=region, frames=f":{WARM}", output=Output(out=out))
    word = Session(config, Progress()).run().as_dict()["verdict"]
    out.unlink()
    return word


def write(path: Path, pictures: Iterator[Image]) -> None:
    """A video of pictures."""
    first = next(pictures)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, first.shape[1::-1])
    for picture in chain([first], pictures):
        writer.write(picture)
    writer.release()


if __name__ == "__main__":
    kind = sys.argv[1]
    lines = soak(kind, int(sys.argv[2]) if sys.argv[2:] else {"face": 20_000, "cuts": 50, "objects": 20}[kind])
    sys.stdout.write("\n".join(lines) + "\n")
    sys.exit(any(line.startswith("BAD") for line in lines))
