"""What is painted looks as if it had been printed: the sample's truth says what that looks like."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app import demo
from app.demo.camera import shading
from app.demo.motion import HEIGHT_MM, WIDTH_MM
from app.options.run import Output, Run
from app.painting.compositing import Compositor
from app.painting.picture import premultiplied
from app.painting.placement import Placement, bounding_box, box_corners
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.terminal.progress import Progress
from tests.app.card import card

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]

FRAMES = 240  # of the demo: the hand comes and goes in 196 to 238


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo, as its users have it, up to where the hand is gone."""
    made = demo.sample()
    path = tmp_path_factory.mktemp("demo") / "demo.rrd"
    Session(Run(str(made.video), roi=made.roi, frames=f":{FRAMES}", output=Output(out=path)), Progress()).run()
    return path


def decibels(squared: float) -> float:
    return float(10 * np.log10(255**2 / squared))


@pytest.mark.slow
def test_the_demo_is_retextured_as_if_it_were_printed(recording: Path) -> None:
    """The composite at the true places of the sheet's points, against the card's colours there times the true light.

    Points that the mesh covers and the true hand does not; light as the sample was rendered, without any fitted gain.
    """
    playback, work = Playback.load(recording), None
    columns, rows = 594, 420
    across, down = np.meshgrid((np.arange(columns) + 0.5) / columns - 0.5, (np.arange(rows) + 0.5) / rows - 0.5)
    xy_mm = np.stack([across * WIDTH_MM, down * HEIGHT_MM], axis=-1).reshape(-1, 2)
    first_px = demo.project(demo.surface(0).points(xy_mm)).astype(np.float32).reshape(rows, columns, 2)
    x, y, w, h = bounding_box(playback.texture_px)
    box = Placement(box_corners((x, y, w, h)))
    small = cv2.GaussianBlur(cv2.resize(card(), (2 * w, 2 * h), interpolation=cv2.INTER_AREA), (0, 0), 0.8)
    within = (first_px - np.float32((x - 0.5, y - 0.5))) * 2 - np.float32(0.5)
    printed = remapped(small, within)
    squares: list[float] = []
    hidden = in_front = painted = free = 0.0
    for i, image in playback.images():
        assert image is not None
        if work is None:
            work = Compositor(image, playback.texture_px, playback.mesh, perspective=True, placement=box)
            mesh_cover = work.first(premultiplied(np.full((4, 4, 3), 255, np.uint8)))
            changed = (mesh_cover != image).any(axis=-1).astype(np.float32)
            covered = remapped(cv2.erode(changed, np.ones((3, 3), np.uint8)), first_px) == 1
        estimate = playback.estimate(i)
        assert estimate is not None
        seen = work.paint(image, premultiplied(card()), estimate.projection_px, estimate.shape[2], playback.W[i].T)
        if i % demo.TRUTH_EVERY:
            continue
        sheet = demo.surface(i)
        places = demo.project(sheet.points(xy_mm)).astype(np.float32).reshape(rows, columns, 2)
        hand = demo.occluder(i).astype(np.uint8)
        light = shading(sheet, xy_mm).reshape(rows, columns, 1) * vignette(places)
        expected = np.clip(printed * light, 0, 255)
        visible = covered & (remapped(cv2.dilate(hand, np.ones((3, 3), np.uint8)).astype(np.float32), places) == 0)
        squares.append(float(((remapped(seen, places) - expected)[visible] ** 2).mean()))
        if not hand.any():
            continue
        still = remapped((np.abs(seen.astype(int) - image).max(axis=-1) <= 8).astype(np.float32), places) > 0.5
        under = covered & (remapped(hand.astype(np.float32), places) == 1)
        hidden, in_front = hidden + under.sum(), in_front + (under & still).sum()
        # Where the card has the page's own colour by chance, painting changes nothing.
        differs = covered & (np.abs(expected - remapped(image, places)).max(axis=-1) > 40)
        painted, free = painted + (differs & visible & ~still).sum(), free + (differs & visible).sum()
    assert decibels(float(np.mean(squares))) > 28  # measured: 29.6
    assert np.median([decibels(s) for s in squares]) > 29  # measured: 30.7
    assert min(decibels(s) for s in squares) > 22  # measured: 22.6 to 22.9, beside the hand
    assert in_front / hidden > 0.92  # measured: 0.939, beside 0.986 when colour alone was enough
    assert painted / free > 0.95  # measured: 0.991


def remapped(picture: NDArray[np.generic], places: NDArray[np.float32]) -> Floats:
    return np.asarray(cv2.remap(picture, places, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), float)  # type: ignore[call-overload]


def vignette(places: NDArray[np.float32]) -> Floats:
    """What the sample's lens takes away towards the corners."""
    squared = ((places - np.float32((320, 240))) ** 2).sum(axis=-1) / 320**2
    return np.asarray(1 - 0.09 * squared, float)[..., None]
