"""Damaged inputs for every command: python -m tests.robustness.fuzz [KIND [FIRST:STOP]]

Kinds are npz, video, rrd, mesh, texture and command; all of them and 0:1000 by default, an hour on two cores.

A case is good when the command ends by itself within two minutes and 2 GB, with exit code 0 or 2, no traceback, one line on
stderr if the code is 2, and all other files as they were. Cases follow from their kinds and numbers.
"""

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from app.environment import environment as completed_environment
from tests.robustness.damage import bytes_changed, command_line, numbers_changed, picture_changed, words_changed

Damage = Callable[[bytes, np.random.Generator], tuple[str, bytes]]

ROOT = Path(__file__).parents[2]
CASES, WORKERS = 1000, 2
SECONDS, BYTES = 120.0, 2 * 2**30
RUN = "--points 60 --modes 5 --frames :14 --rest-shape plane --bootstrap-frames 4 --no-final-pass --jobs 1 --out out.rrd"
COMMANDS = {
    "video.mp4": [
        f"run FILE {RUN}",
        f"run FILE {RUN} --image video",
        "retexture FILE --texture picture.png --out o.mp4 --frames :6",
    ],
    "video.webm": [f"run FILE {RUN}"],
    "picture.png": [
        f"run video.mp4 --mask FILE {RUN}",
        f"run video.mp4 --texture FILE {RUN}",
        "retexture run.rrd --texture FILE --out o.mp4",
    ],
    "tracks.npz": ["evaluate FILE --modes 5 --json", "evaluate FILE --modes 5 --rest-shape first-truth --shapes-out s.npz"],
    "truth.npz": [f"run video.mp4 --ground-truth FILE {RUN}"],
    "run.rrd": [
        "review FILE --csv o.csv",
        "review run.rrd FILE --json",
        "export FILE --format glb --out o.glb",
        "export FILE --format npz --out o.npz",
        "export FILE --format mp4 --out o.mp4",
        "retexture FILE --texture picture.png --out o.mp4",
        "modes FILE --out o.png",
    ],
    "sheet.obj": [f"run video.mp4 --rest-shape FILE {RUN.replace('--rest-shape plane', '')}"],
    "sheet.glb": [f"run video.mp4 --rest-shape FILE {RUN.replace('--rest-shape plane', '')}"],
}
KINDS: dict[str, tuple[list[str], list[Damage]]] = {  # files, and what is done to them beside changing bytes
    "npz": (["tracks.npz", "truth.npz"], [numbers_changed]),
    "video": (["video.mp4", "video.webm"], []),
    "rrd": (["run.rrd"], []),
    "mesh": (["sheet.obj", "sheet.glb"], [words_changed]),
    "texture": (["picture.png"], [picture_changed]),
}
ALL = [*KINDS, "command"]


@dataclass(frozen=True)
class Case:
    """One damaged file and what is done with it."""

    kind: str
    number: int
    name: str
    damage: str
    arguments: list[str]


def make(kind: str, number: int, samples: Path, folder: Path) -> Case:
    """The case of that kind and number, with its files in a folder of its own."""
    rng = np.random.default_rng([*kind.encode(), number])
    for sample in samples.iterdir():
        os.link(sample, folder / sample.name)
    if kind == "command":
        return Case(kind, number, "", "", command_line(rng))
    files, damages = KINDS[kind]
    name = files[number % len(files)]
    suffix, data = name.split(".")[1], (samples / name).read_bytes()
    if damages and suffix != "glb" and rng.random() < 0.6:
        damage, data = damages[0](data, rng)
    else:
        damage, data = bytes_changed(data, rng, suffix)
    bad = f"bad_{name}"
    (folder / bad).write_bytes(data)
    line = str(rng.choice(COMMANDS[name]))
    return Case(kind, number, name, damage, [bad if word == "FILE" else word for word in line.split()])


def complaint(case: Case, folder: Path, before: dict[str, bytes]) -> str | None:
    """Carry the case out in a forked process; what is wrong with it, or None."""
    errors = folder.with_suffix(".err")
    started = time.monotonic()
    child = os.fork()
    if child == 0:
        carry_out(case, folder, errors)
    while True:
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            break
        if time.monotonic() - started > SECONDS:
            os.kill(child, signal.SIGKILL)
            os.wait4(child, 0)
            return f"longer than {SECONDS:.0f} s"
        time.sleep(0.01)
    text = errors.read_text(errors="replace")
    code = os.waitstatus_to_exitcode(status)
    if code not in (0, 2, 1 if case.arguments[0] == "batch" else 0) or "Traceback" in text:
        return f"exit code {code}: {text[-1500:]}"
    if code == 2 and sum(line.startswith("error: ") for line in text.splitlines()) != 1:
        return f"not one line: {text[-500:]}"
    if usage.ru_maxrss * 1024 > BYTES:
        return f"{usage.ru_maxrss / 2**10:.0f} MB"
    changed = [name for name, data in before.items() if (folder / name).read_bytes() != data]
    return f"changed {changed}" if changed else None


def carry_out(case: Case, folder: Path, errors: Path) -> None:
    """In the forked process: the command line, never to return."""
    code = 70
    try:
        os.chdir(folder)
        out = os.open(errors, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(out, 1)
        os.dup2(out, 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        sys.argv = ["modeshape", *case.arguments]
        from app.commands.cli import main

        try:
            main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        except BaseException:
            import traceback

            traceback.print_exc()
        sys.stderr.flush()
        sys.stdout.flush()
    finally:
        os._exit(code)


def work(samples: Path, kinds: list[str], first: int, stop: int) -> Iterator[dict[str, object]]:
    """Every `WORKERS`-th case, one after another."""
    import app.commands.export
    import app.commands.modes
    import app.commands.retexture
    import app.commands.review
    import app.pipeline.evaluate
    import app.pipeline.session
    import app.processes.child
    from tests.app import forked

    app.processes.child.started = forked.started  # type: ignore[assignment]
    forked.loaded()
    kept = {path.name: path.read_bytes() for path in samples.iterdir()}
    for kind, number in product(kinds, range(first, stop, WORKERS)):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name, "case")
            folder.mkdir()
            case = make(kind, number, samples, folder)
            before = kept | {path.name: path.read_bytes() for path in folder.iterdir()}
            started = time.monotonic()
            wrong = complaint(case, folder, before)
            yield {
                "kind": kind, "case": number, "file": case.name, "damage": case.damage, "command": " ".join(case.arguments),
                "seconds": time.monotonic() - started, "wrong": wrong,
            }  # fmt: skip


def make_samples(folder: Path) -> None:
    """Whole files of every kind."""
    import cv2
    import trimesh

    from tests.app.command_line import in_own_process, turning, write_video
    from tests.tracking.scene import SIZE

    pictures = list(turning(16))
    write_video(folder / "video.mp4", pictures)
    writer = cv2.VideoWriter(str(folder / "video.webm"), cv2.VideoWriter.fourcc(*"VP80"), 30.0, SIZE)
    for picture in pictures:
        writer.write(picture)
    writer.release()
    white = np.zeros((*SIZE[::-1], 3), np.uint8)
    white[30:-30, 40:-40] = 255
    cv2.imwrite(str(folder / "picture.png"), white)
    done = in_own_process(folder, "run", "video.mp4", *RUN.replace("out.rrd", "run.rrd").split(), "--tracks-out", "t.npz")
    assert done.code == 0, done.err
    with np.load(folder / "t.npz") as tracks:
        W, visible = tracks["W"], tracks["visible"]
    shapes = np.concatenate([W, 0.1 * W[:, :1]], axis=1)[::4]
    frames = np.arange(len(W))[::4]
    np.savez(folder / "tracks.npz", W=np.nan_to_num(W), visible=visible, S_gt=np.nan_to_num(shapes), gt_frames=frames)
    np.savez(folder / "truth.npz", W_px=np.nan_to_num(W[::4]), S_gt=np.nan_to_num(shapes), gt_frames=frames)
    (folder / "t.npz").unlink()
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(45, 275, 8), np.linspace(35, 205, 6)))
    faces = [(r * 8 + c, r * 8 + c + 1, r * 8 + c + 8) for r in range(5) for c in range(7)]
    mesh = trimesh.Trimesh(np.stack([x, y, 0.0 * x], axis=1), faces)
    mesh.export(folder / "sheet.obj")
    mesh.export(folder / "sheet.glb")


def fuzz(samples: Path, kinds: list[str], cases: range) -> list[dict[str, object]]:
    """Those of the cases with a complaint; workers share them. `samples` is a folder of whole files."""
    environment = completed_environment() | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "tests.robustness.fuzz", "--worker", str(samples), ",".join(kinds)]
    workers = [
        subprocess.Popen([*command, *numbers], cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
        for numbers in ((str(cases.start + k), str(cases.stop)) for k in range(WORKERS))
    ]
    results = [json.loads(line) for worker in workers for line in worker.communicate()[0].splitlines()]
    assert len(results) == len(kinds) * len(cases), "a worker ended early"
    return [result for result in results if result["wrong"]]


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        for result in work(Path(sys.argv[2]), sys.argv[3].split(","), int(sys.argv[4]), int(sys.argv[5])):
            sys.stdout.write(json.dumps(result) + "\n")
            sys.stdout.flush()
        sys.exit()
    first, _, stop = (sys.argv[2] if sys.argv[2:] else f"0:{CASES}").partition(":")
    with tempfile.TemporaryDirectory() as name:
        make_samples(Path(name))
        kinds, cases = sys.argv[1:2] or ALL, range(int(first), int(stop))
        bad = fuzz(Path(name), kinds, cases)
    for one in bad:
        sys.stdout.write(json.dumps(one, indent=1) + "\n")
    sys.stdout.write(f"{len(bad)} cases went wrong\n")
    sys.exit(1 if bad else 0)
