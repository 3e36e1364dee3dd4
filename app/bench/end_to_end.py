"""Part 3 to 5: whole runs beside the bare OpenCV loop, their start, their frame times and their memory."""

import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, time
from typing import Any

import numpy as np

from app.bench.drift import drift_px
from app.bench.own_process import apart
from app.bench.timing import Log

ROOT = Path(__file__).parents[2]
KINECT = ROOT.parent / "shared" / "data" / "kinect_paper.mp4"  # research data, not part of the program
KINECT_ROI = (195, 95, 325, 265)
POINTS = (800, 3_000)
MANY_POINTS, MANY_FRAMES = 28_887, 12
HELP = (sys.executable, "-m", "modeshape", "--help")
HELP_REPEATS = 5
QUICK_FRAMES = 120


@dataclass(frozen=True)
class WholeRun:
    """A command's run, from its start to its end."""

    video: str
    points: int
    frames: int
    first_frame_s: float
    """From the start of the command to the first frame done."""
    loop_s: float
    """From the first frame done to the last."""
    wall_s: float
    """The same, and until the recording is complete."""
    bare_s: float
    """The same frames decoded, made gray and followed by the same calls of Lucas-Kanade, nothing else."""
    whole_s: float
    """From the command to its end."""
    median_ms: float
    p95_ms: float
    latency_ms: dict[str, float]
    """From frame to mesh."""
    core_ms: dict[str, float]
    """Processor time a frame, by stage, from the first frame done to the last."""
    bare_core_ms: float
    """The same of the bare loop."""
    peak_mb: float
    memory_mb: float
    """Of all processes, while frames go on."""
    drift_px: float
    """Median distance of tracked points from the truth."""
    unwritten_s: float
    """Longest time between two frames after which the file of the recording had grown."""


def whole_runs(*, quick: bool, log: Log) -> Iterator[WholeRun]:
    """Of the sample and, where it is at hand, of the Kinect's paper."""
    from app.demo import sample

    log("rendering the sample video")
    made = sample()
    videos = [("demo", made.video, made.truth, made.roi)]
    if KINECT.exists():
        videos = [("kinect_paper", KINECT, KINECT.with_name("kinect_paper_gt.npz"), KINECT_ROI), *videos]
    for name, video, truth, roi in videos[: 1 if quick else None]:
        for points in POINTS[: 1 if quick else None]:
            log(f"run of {name}, {points} points")
            yield whole_run(name, video, truth, roi, points, QUICK_FRAMES if quick else None)


def whole_run(
    name: str, video: Path, truth: Path, roi: tuple[int, int, int, int], points: int, frames: int | None
) -> WholeRun:
    """One run and its bare loop, in processes of their own."""
    words = run_apart(video, truth, roi, points, frames)
    stamps = np.array(words["stamps"])
    bare = child("app.bench.bare_loop", str(video), *map(str, roi), str(points), str(len(stamps)))
    each_ms = 1e3 * np.diff(stamps)
    return WholeRun(
        name,
        points,
        len(stamps),
        first_frame_s=stamps[0] - words["started"],
        loop_s=float(stamps[-1] - stamps[0]),
        wall_s=words["complete"] - stamps[0],
        whole_s=words["ended"] - words["started"],
        latency_ms=words["latency_ms"],
        core_ms=words["core_ms"],
        bare_core_ms=1e3 * bare["used_s"] / (len(stamps) - 1),
        memory_mb=words["memory_mb"],
        bare_s=bare["seconds"],
        median_ms=float(np.median(each_ms)),
        p95_ms=float(np.percentile(each_ms, 95)),
        peak_mb=words["peak_mb"],
        drift_px=words["drift_px"],
        unwritten_s=words["unwritten_s"],
    )


def many_points(log: Log) -> tuple[int, float]:
    """Points and peak memory in MB of `evaluate` on as many points as the paper's largest model, for a few frames."""
    log(f"evaluate with {MANY_POINTS} points")
    return apart(evaluate_many)


def evaluate_many() -> int:
    """Tracks of a surface that turns, reconstructed from its first true shape; returns the number of points."""
    from app.options.evaluate import Evaluate
    from app.options.model import Model
    from app.pipeline.evaluate import evaluate
    from app.rivals.problems import FOCAL_PX, surface
    from app.terminal.progress import Progress
    from reconstruction.camera import quaternion_exp, rotation_from_quaternion
    from tracking.tracks import Tracks

    shape = surface(MANY_POINTS)
    turns = rotation_from_quaternion(
        quaternion_exp(np.linspace(0, 0.5, MANY_FRAMES)[:, None] * np.array([[0.3, 1.0, 0.2]]))
    )
    shapes = turns @ shape + np.array([[0.0], [0.0], [FOCAL_PX]])
    W = FOCAL_PX * shapes[:, :2] / shapes[:, 2:]
    K = np.diag([FOCAL_PX, FOCAL_PX, 1.0])
    seen = np.ones((MANY_FRAMES, MANY_POINTS), np.bool_)
    with TemporaryDirectory(prefix="modeshape-") as folder:
        path = Path(folder, "tracks.npz")
        with path.open("wb") as file:
            Tracks(W, seen, K=K, S_gt=shapes, gt_frames=np.arange(MANY_FRAMES)).save(file)
        evaluate(Evaluate(path, rest_shape="first-truth", model=Model(modes=30)), Progress())
    return MANY_POINTS


def run_apart(
    video: Path, truth: Path | None, roi: tuple[int, int, int, int], points: int, frames: int | None
) -> dict[str, Any]:
    """`modeshape run` in a process that notes when each frame is done."""
    with TemporaryDirectory(prefix="modeshape-") as folder:
        where = ["--roi", *map(str, roi), "--points", str(points), "--frames", f":{frames or ''}"]
        tracks = Path(folder, "tracks.npz")
        arguments = [str(video), *where, "--out", str(Path(folder, "run.rrd")), "--tracks-out", str(tracks)]
        started = time()
        words = child("app.bench.timed_run", *arguments) | {"started": started, "ended": time()}
        return words if truth is None else words | {"drift_px": drift_px(tracks, truth)}


def help_s(log: Log) -> float:
    """Seconds of `modeshape --help`, the least of several."""
    log("modeshape --help")
    least = np.inf
    for _ in range(HELP_REPEATS):
        started = perf_counter()
        subprocess.run(HELP, cwd=ROOT, capture_output=True, check=True)
        least = min(least, perf_counter() - started)
    return least


def child(module: str, *arguments: str) -> dict[str, Any]:
    """What a module of ours, run by itself, prints as JSON; nothing is imported from the current folder."""
    command = [sys.executable, "-P", "-m", module, *arguments]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
    words: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return words


def ratios(runs: list[WholeRun], help_seconds: float, many: tuple[int, float] | None) -> dict[str, float | None]:
    """The figures that have targets."""
    words: dict[str, float | None] = {}
    for run in runs:
        name = f"{run.video}_{run.points}"
        words |= {
            f"wall_over_bare_{name}": run.wall_s / run.bare_s,
            f"fps_{name}": (run.frames - 1) / run.loop_s,
            f"p95_over_median_{name}": run.p95_ms / run.median_ms,
            f"core_ms_{name}": sum(run.core_ms.values()),
            f"core_over_bare_{name}": sum(run.core_ms.values()) / run.bare_core_ms,
            f"latency_ms_{name}": run.latency_ms["median"],
            f"whole_s_{name}": run.whole_s,
            f"memory_mb_{name}": run.memory_mb,
            f"drift_px_{name}": run.drift_px,
            f"unwritten_s_{name}": run.unwritten_s,
        }
    first = min(run.first_frame_s for run in runs if run.points == min(POINTS))
    if many is not None:
        words[f"peak_mb_{many[0]}_points"] = many[1]
    return words | {"help_s": help_seconds, "first_frame_s": first}
