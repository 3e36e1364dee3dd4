"""Pixels stay painted, or not painted, while nothing moves there."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from app import demo
from app.options.run import Output, Run
from app.painting.compositing import Compositor
from app.painting.picture import premultiplied
from app.painting.placement import Placement, outline_of
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.terminal.progress import Progress

Flags = NDArray[np.bool_]

SAME = 8.0  # grey levels, of a pixel in which nothing is seen to move
STILL_PX = 0.5  # of the surface
MOST = 0.005  # share of the surface's pixels
CORNERS = (172.0, 77.0, 573.0, 107.0, 568.0, 398.0, 143.0, 365.0)  # of kinect_paper


def changes(run: Run) -> list[float]:
    """Share of the painted pixels that change side from each frame to the next, without motion of image or surface."""
    Session(run, Progress()).run()
    assert run.output.out is not None
    playback = Playback.load(run.output.out)
    pictures = [premultiplied(np.full((4, 4, 3), level, np.uint8)) for level in (0, 255)]
    works: list[Compositor] = []
    shares: list[float] = []
    before: tuple[Flags, NDArray[np.uint8], NDArray[np.float64]] | None = None
    for i, image in playback.images():
        assert image is not None
        placement = Placement(outline=outline_of(run.outline))
        while len(works) < 2:
            works.append(Compositor(image, playback.texture_px, playback.mesh, perspective=True, placement=placement))
        estimate = playback.estimate(i)
        assert estimate is not None
        at = (estimate.projection_px, estimate.shape[2], playback.W[i].T)
        dark, bright = (work.paint(image, picture, *at) for work, picture in zip(works, pictures, strict=True))
        painted = cv2.absdiff(dark, bright).max(axis=2) > 60
        if before is not None:
            same = cv2.GaussianBlur(cv2.absdiff(image, before[1]).max(axis=2), (0, 0), 1.5) < SAME
            rows, columns = np.nonzero((painted != before[0]) & same)
            _, nearest = cKDTree(at[0]).query(np.column_stack([columns, rows]))
            moved = np.linalg.norm(at[0] - before[2], axis=1)[nearest]
            shares.append(float((moved < STILL_PX).sum() / max(painted.sum(), 1)))
        before = (painted, image, at[0])
    return shares


@pytest.mark.slow
def test_the_sample_does_not_flicker_nor_does_the_hand(tmp_path: Path) -> None:
    made = demo.sample()
    shares = changes(Run(str(made.video), roi=made.roi, frames="120:240", output=Output(out=tmp_path / "demo.rrd")))
    assert max(shares) <= MOST  # measured: 0.0008


@pytest.mark.slow
def test_a_sheet_of_paper_painted_to_its_edge_does_not_flicker(tmp_path: Path, shared_data: Path) -> None:
    video = shared_data / "kinect_paper.mp4"
    shares = changes(Run(str(video), corners=CORNERS, frames=":113", output=Output(out=tmp_path / "paper.rrd")))
    assert max(shares) <= MOST  # measured: 0.0013
