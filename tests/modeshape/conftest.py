"""A folder as the examples expect it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import modeshape
from app import demo

FRAMES = 70
REGION = (135, 123, 341, 243)


@pytest.fixture(scope="session")
def paper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with paper.mp4, its recording in recordings/paper.rrd, and its tracks in tracks.npy."""
    folder = tmp_path_factory.mktemp("paper")
    writer = cv2.VideoWriter(str(folder / "paper.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), demo.FPS, demo.SIZE)
    for frame in range(FRAMES):
        writer.write(demo.render(frame))
    writer.release()
    recording = folder / "recordings" / "paper.rrd"
    run = modeshape.reconstruct(folder / "paper.mp4", region=REGION, points=120, recording=recording)
    np.save(folder / "tracks.npy", [frame.points_px for frame in run])
    return folder
