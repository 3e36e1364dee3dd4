"""The border of a surface by its colours, in pictures that are composed."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.tracking.scene import texture
from tracking.region.border import at_colours, inset

Image = NDArray[np.uint8]
CENTRE, RADIUS, SPACING = (150, 120), 60, 12
BLUE, SKIN = (160, 80, 20), (90, 120, 180)


def disc(radius: int) -> Image:
    return cv2.circle(np.zeros((240, 320), np.uint8), CENTRE, radius, (255,), cv2.FILLED)


def grid(radius: int) -> NDArray[np.float64]:
    """Points on a disc, (n, 2)."""
    x, y = np.meshgrid(np.arange(0, 320, SPACING), np.arange(0, 240, SPACING))
    points = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)
    return points[np.linalg.norm(points - CENTRE, axis=1) < radius]


def picture(inside: tuple[int, int, int], outside: tuple[int, int, int]) -> Image:
    """A disc of one colour before a wall of another, both with texture."""
    colour = np.where(disc(RADIUS)[:, :, None] > 0, np.array(inside), np.array(outside))
    return (colour + (texture(3)[:240, :320].astype(int) - 128) // 6).clip(0, 255).astype(np.uint8)


def overlap(one: Image, other: Image) -> float:
    return float(((one > 0) & (other > 0)).sum() / ((one > 0) | (other > 0)).sum())


@pytest.mark.parametrize("off", [-8, 10], ids=["too narrow", "too wide"])
def test_border_lies_where_colours_change(off: int) -> None:
    rough, truth = disc(RADIUS + off), disc(RADIUS)
    found = at_colours(rough, picture(SKIN, BLUE), grid(RADIUS))
    assert overlap(found, truth) > 0.9 > overlap(rough, truth) + 0.1
    assert not found[disc(RADIUS + 1) == 0].any(), "nothing of the wall"


def test_points_on_the_contour_are_left_out_and_those_of_the_surface_kept() -> None:
    points = grid(RADIUS + 4)
    found = at_colours(disc(RADIUS + 14), picture(SKIN, BLUE), points)
    x, y = points.astype(int).T
    beside = np.linalg.norm(points - CENTRE, axis=1) > RADIUS
    assert beside.any()
    assert not found[y, x][beside].any()
    assert found[y, x][np.linalg.norm(points - CENTRE, axis=1) < RADIUS - 6].all()


@pytest.mark.parametrize("its_own", [True, False])
def test_what_lies_apart_is_the_surfaces_if_its_colours_are(its_own: bool) -> None:
    """A hand that holds it, beyond a margin without points, or its own corner."""
    hand = (slice(100, 140), slice(245, 290))
    image = picture(SKIN, BLUE)
    image[hand] = image[100:140, 130:175] if its_own else image[100:140, 20:65] // 2
    image[hand[0], 205:245] = SKIN
    rough = disc(RADIUS)
    rough[100:140, 150:290] = 255
    image[:60, :60] = image[:60, :60] // 2  # and another hand, which does not move
    x, y = np.meshgrid([255, 267, 280], [110, 125])
    held = np.column_stack([x.ravel(), y.ravel()]).astype(np.float64)
    found = at_colours(rough, image, np.concatenate([grid(RADIUS), held]))
    x, y = held.astype(int).T
    assert (found[y, x] > 0).mean() == pytest.approx(float(its_own), abs=0.2)


def test_colours_that_cut_the_surface_are_not_believed() -> None:
    rough = disc(RADIUS)
    image = np.full((240, 320, 3), 90, np.uint8)
    image[disc(RADIUS - 18) > 0] = (40, 160, 220)  # a print with a margin like the wall, on which there are points, too
    assert at_colours(rough, image, grid(RADIUS)) is rough


@settings(max_examples=60, deadline=None)
@given(
    st.integers(2, 60), st.integers(2, 60), st.integers(0, 2**32 - 1), st.sampled_from(["flat", "noise"]), st.floats(0, 1)
)
def test_any_mask_gives_a_mask(height: int, width: int, seed: int, kind: str, share: float) -> None:
    rng = np.random.default_rng(seed)
    image = np.full((height, width, 3), 7, np.uint8)
    if kind == "noise":
        image = rng.integers(0, 256, (height, width, 3), np.uint8)
    mask = np.where(rng.random((height, width)) <= share, 255, 0).astype(np.uint8)
    points = rng.uniform(-3, max(height, width) + 3, (5, 2))
    found = at_colours(mask, image, points)
    assert found.shape == mask.shape
    assert found.dtype == np.uint8
    assert set(np.unique(found)) <= {0, 255}


def test_what_windows_at_the_border_would_see_of_the_rest_is_left_out() -> None:
    region = np.zeros((240, 320), np.uint8)
    region[40:200, 100:320] = 255  # a rectangle that somebody drew
    large = region.copy()
    large[:, :110] = 0  # the surface is all but its left end
    left = inset(large, region)
    assert not left[:, : 110 + 6].any()
    assert (left[:, 110 + 8 :] == large[:, 110 + 8 :]).all()  # nothing of the rest lies beyond where it was drawn
    small = np.asarray(disc(20) & region)
    assert 0.75 < np.count_nonzero(inset(small, region)) / np.count_nonzero(small) < 0.95
    assert (inset(region, region) == region).all()
