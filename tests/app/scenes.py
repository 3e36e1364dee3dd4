"""Videos of one sheet after another, and a quick run over them."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.terminal.progress import Progress
from tests.app.command_line import turning, write_video

Image = NDArray[np.uint8]

FAST = ("--rest-shape", "plane", "--bootstrap-frames", 5, "--points", 100, "--modes", 5)
GOOD = (*FAST[:3], 20, *FAST[4:])
RED = np.full((20, 30, 3), (0, 0, 255), np.uint8)


def another(frames: int) -> Iterable[Image]:
    """A sheet that fills the picture: on black, edges of two sheets look alike."""
    return turning(frames, seed=5, scale=1.2)


def scenes(path: Path, *pictures: Iterable[Image]) -> Path:
    """A video of one scene after another."""
    return write_video(path, (picture for scene in pictures for picture in scene))


def run(video: Path, bootstrap_frames: int = 5, rest_shape: str = "plane", **output: object) -> dict[str, object]:
    """The words of a quick run that records run.rrd."""
    model = Model(modes=5, bootstrap_frames=bootstrap_frames)
    written = Output(out=Path("run.rrd"), image="none", **output)  # type: ignore[arg-type]
    config = Run(str(video), points=100, rest_shape=rest_shape, final_pass=False, model=model, output=written)
    return Session(config, Progress()).run().as_dict()
