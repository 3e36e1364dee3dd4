"""The command line as a person uses it, inside the test's process or in one of its own; and small videos for it."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.commands.cli import main
from tests.tracking.scene import SIZE, texture

Image = NDArray[np.uint8]
PROGRAM = (sys.executable, "-m", "modeshape")
ROOT = Path(__file__).parents[2]
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT)}


@dataclass(frozen=True)
class Outcome:
    """What a command left on the terminal."""

    code: int
    out: str
    err: str


Command = Callable[..., Outcome]


def in_process(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    """A function that runs `modeshape ARGUMENTS…` here: quick, and everything on the file descriptors is seen."""

    def modeshape(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["modeshape", *map(str, arguments)])
        handler = signal.getsignal(signal.SIGTERM)
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        signal.signal(signal.SIGTERM, handler)
        return Outcome(int(stop.value.code or 0), *capfd.readouterr())

    return modeshape


def in_own_process(folder: Path, *arguments: object) -> Outcome:
    """`modeshape ARGUMENTS…` as the shell would start it."""
    command = [*PROGRAM, *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False)
    return Outcome(done.returncode, done.stdout, done.stderr)


def write_video(path: Path, pictures: Iterable[Image]) -> Path:
    """An mp4 of pictures of SIZE, 30 a second."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SIZE)
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return path


def grain(picture: Image, rng: np.random.Generator) -> Image:
    """A camera's noise."""
    return np.clip(picture + rng.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8)


def still(frames: int) -> Iterable[Image]:
    """A textured surface that does not move."""
    rng = np.random.default_rng(0)
    return (grain(texture(), rng) for _ in range(frames))


def turning(frames: int, seed: int = 0, scale: float = 0.7) -> Iterable[Image]:
    """A textured flat sheet (its texture by seed) that turns by 35° to and fro; the focal length is one picture's width."""
    rng = np.random.default_rng(0)
    page, (width, height) = texture(seed), SIZE
    K = np.array([[width, 0.0, width / 2], [0.0, width, height / 2], [0.0, 0.0, 1.0]])
    for f in range(frames):
        R, _ = cv2.Rodrigues(np.deg2rad([12 * np.sin(f / 9), 35 * np.sin(f / 12), 0.0]))
        placed = np.column_stack([scale * R[:, 0], scale * R[:, 1], [0.0, 0.0, float(width)]])
        to_sheet = np.array([[1.0, 0.0, -width / 2], [0.0, 1.0, -height / 2], [0.0, 0.0, 1.0]])
        yield grain(cv2.warpPerspective(page, K @ placed @ to_sheet, SIZE), rng)
