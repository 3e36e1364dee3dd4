"""What is in front of a surface, and what only looks so."""

import cv2
import numpy as np
from numpy.typing import NDArray

from app.painting.compositing import Compositor
from tests.app.painting.scene import BOX, MESH, POINTS, SCENE, SIZE, Image, compositor, inner, paint


def hand(frame: Image, left: int, top: int) -> tuple[Image, NDArray[np.bool_]]:
    """An arm of skin colour from below, to (left, top)."""
    mask = np.zeros(SIZE[::-1], np.uint8)
    cv2.rectangle(mask, (left, top), (left + 50, SIZE[1]), 255, -1)
    cv2.circle(mask, (left + 25, top), 25, 255, -1)
    soft = cv2.GaussianBlur(mask, (0, 0), 1.0)[..., None] / 255
    skin = np.array((110, 145, 205)) + 12 * np.sin(np.arange(SIZE[0]) / 9)[None, :, None]
    return (frame * (1 - soft) + skin * soft).astype(np.uint8), mask > 127


def test_a_hand_stays_in_front_and_the_rest_is_painted() -> None:
    work = compositor()
    for top in range(240, 120, -10):
        frame, mask = hand(SCENE, 140, top)
        near = cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8))[
            POINTS.astype(int)[:, 1], POINTS.astype(int)[:, 0]
        ]
        seen = paint(work, frame, observed=np.where(near[:, None] > 0, np.nan, POINTS))
    untouched = np.abs(seen.astype(int) - frame).max(axis=-1) <= 8
    sheet = np.zeros(SIZE[::-1], bool)
    sheet[inner()] = True
    inside = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0  # at its edge it has the colour of beside
    assert untouched[inside & sheet].mean() > 0.95
    assert (~untouched)[~mask & sheet].mean() > 0.96
    for _ in range(3):
        seen = paint(work, SCENE)
    assert (seen[inner()] != SCENE[inner()]).any(axis=-1).mean() > 0.99  # and it is gone at once


def clouds() -> tuple[Image, NDArray[np.bool_]]:
    """The scene with pale clouds printed on blue, one of them at the sheet's edge; and where they are."""
    x, y, w, h = BOX
    soft = np.zeros(SIZE[::-1], np.float32)
    for place in ((95, 60), (180, 100), (250, 150), (110, 170)):
        cv2.ellipse(soft, place, (26, 14), 0, 0, 360, 1.0, -1)
    soft = cv2.GaussianBlur(soft, (0, 0), 3)
    blue = np.zeros((*SIZE[::-1], 3), np.float32)
    blue[:] = (190, 140, 90)
    print_ = blue + soft[..., None] * (np.array((235, 225, 222)) - blue)
    image = SCENE.astype(np.float32)
    image[y : y + h, x : x + w] = 0.75 * print_[y : y + h, x : x + w] + 0.25 * image[y : y + h, x : x + w]
    return image.astype(np.uint8), soft > 0.5


def test_printed_clouds_are_no_hand_whatever_their_colour_does() -> None:
    first, where = clouds()
    work = Compositor(first, POINTS, MESH, perspective=True)
    rng = np.random.default_rng(5)
    for k in range(30):
        warm = 1 + 0.25 * np.sin(k / 4) * where[..., None] * np.array((-1.0, 0.2, 1.0))  # as if they were of another ink
        frame = np.clip(first * warm + rng.normal(0, 2, first.shape), 0, 255).astype(np.uint8)
        seen = paint(work, frame)
        assert (np.abs(seen.astype(int) - frame).max(axis=-1) > 0)[inner()].mean() > 0.99


def test_nothing_is_in_front_where_points_are_seen_or_the_surface_is_merely_displaced() -> None:
    for observed, shift in ((POINTS, 0), (np.full_like(POINTS, np.nan), 3)):
        work = compositor()
        paint(work, SCENE)
        frame = SCENE.copy()
        if shift:  # a part of the sheet has come away from where the shape has it
            frame[150:190, 100:200] = np.roll(SCENE, shift, axis=1)[150:190, 100:200]
        else:  # it changed its colour all at once
            frame[150:190, 100:200] = SCENE[150:190, 100:200, ::-1] // 2 + (60, 80, 110)
        seen = paint(work, frame, observed=observed)
        assert (np.abs(seen.astype(int) - frame).max(axis=-1) > 0)[inner()].mean() > 0.98


def test_a_hand_at_rest_stays_in_front() -> None:
    work = compositor()
    for top in (*range(240, 150, -10), *[150] * 30):
        frame, mask = hand(SCENE, 140, top)
        inside = cv2.erode(mask.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        near = mask[POINTS.astype(int)[:, 1], POINTS.astype(int)[:, 0]]
        seen = paint(work, frame, observed=np.where(near[:, None], np.nan, POINTS))
    sheet = np.zeros(SIZE[::-1], bool)
    sheet[inner()] = True
    assert (np.abs(seen.astype(int) - frame).max(axis=-1) <= 8)[inside & sheet].mean() > 0.97


def test_a_mouth_that_opens_is_no_hand() -> None:
    work = compositor()
    for size in range(2, 14, 2):
        frame = SCENE.copy()
        cv2.ellipse(frame, (160, 120), (2 * size, size), 0, 0, 360, (40, 20, 20), -1)
        seen = paint(work, frame)
    assert (seen[inner()] != frame[inner()]).any(axis=-1).mean() > 0.97
