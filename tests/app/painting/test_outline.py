"""The edge of a sheet, where its net ends before or beyond it."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.painting.compositing import Compositor
from app.painting.outline import Outline
from app.painting.placement import Placement
from reconstruction.basis.mesh import triangulate
from tests.app.painting.scene import GREY, SIZE, Image

SHEET = np.array(((60.0, 50.0), (260.0, 50.0), (260.0, 190.0), (60.0, 190.0)))
SHAPE = (11, 15)


def filmed(sheet: NDArray[np.float64], wall: float = 90.0) -> Image:
    """Bare paper with something printed in its middle, before a wall."""
    image = np.full((*SIZE[::-1], 3), wall, np.uint8)
    cv2.fillConvexPoly(image, np.rint(sheet * 16).astype(np.int32), (225, 230, 235), cv2.LINE_AA, 4)
    rng = np.random.default_rng(2)
    low, high = sheet.min(axis=0) + 45, sheet.max(axis=0) - 55
    for x, y in rng.uniform(low, high, (60, 2)).astype(int):
        cv2.rectangle(image, (x, y), (x + int(rng.integers(2, 9)), y + 4), rng.integers(0, 200, 3).tolist(), -1)
    return np.clip(image + np.random.default_rng(3).normal(0, 2, image.shape), 0, 255).astype(np.uint8)


def nodes(sheet: NDArray[np.float64]) -> NDArray[np.float64]:
    (left, top), (right, bottom) = sheet[0], sheet[2]
    across, down = np.linspace(left, right, SHAPE[1]), np.linspace(top, bottom, SHAPE[0])
    return np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("short", [-4.0, 3.0, 6.0])
def test_the_net_is_drawn_to_the_edge(short: float) -> None:
    outline = Outline(SHAPE, filmed(SHEET), nodes(SHEET))
    inwards = SHEET + short * np.array(((1, 1), (-1, 1), (-1, -1), (1, -1)))
    image, net = filmed(SHEET), nodes(inwards)
    for _ in range(12):
        off = outline.off(image, net)
    reached = net[outline.border] + off
    low, high = reached.min(axis=0), reached.max(axis=0)
    assert np.abs((*low, *high) - SHEET[[0, 2]].ravel()).max() < 1.2


def test_fingers_over_the_edge_do_not_bend_it() -> None:
    outline = Outline(SHAPE, filmed(SHEET), nodes(SHEET))
    image = filmed(SHEET)
    cv2.circle(image, (60, 120), 14, (110, 145, 205), -1)
    for _ in range(12):
        off = outline.off(image, nodes(SHEET))
    assert np.abs(off).max() < 1.5


def test_an_edge_that_cannot_be_seen_stays_where_the_net_is() -> None:
    outline = Outline(SHAPE, filmed(SHEET, 230.0), nodes(SHEET))
    assert np.abs(outline.off(filmed(SHEET, 230.0), nodes(SHEET + 4))).max() == 0


def test_the_picture_reaches_the_edge_of_a_sheet_whose_corners_are_told() -> None:
    x, y = np.meshgrid(np.linspace(105, 210, 12), np.linspace(90, 140, 8))
    points = np.column_stack([x.ravel(), y.ravel()])
    image, depth = filmed(SHEET), np.full(len(points), 300.0)
    work = Compositor(image, points, triangulate(points), perspective=True, placement=Placement(outline=SHEET))
    narrow = (points - (160, 120)) * 0.97 + (160, 120)  # the shape is a little small
    for _ in range(8):
        seen = work.paint(image, GREY, narrow, depth, narrow)
    changed = np.abs(seen.astype(int) - image).max(axis=-1) > 12
    wanted = np.zeros(SIZE[::-1], bool)
    wanted[51:189, 61:259] = True
    around = np.ones(SIZE[::-1], bool)
    around[48:193, 58:263] = False
    assert changed[wanted].mean() > 0.99
    assert not changed[around].any()
