import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.painting.compositing import Compositor, even
from app.painting.picture import premultiplied
from app.painting.placement import Placement, box_corners
from app.painting.surface import Surface
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import triangulate

Image = NDArray[np.uint8]
SIZE = (320, 240)
BOX = (60, 50, 200, 140)  # the sheet: left, top, width, height
GRID = np.stack(np.meshgrid(np.linspace(60, 259, 16), np.linspace(50, 189, 12)), axis=-1).reshape(-1, 2)


def jittered() -> NDArray[np.float64]:
    low, high = GRID.min(axis=0), GRID.max(axis=0)
    movable = ((low < GRID) & (high > GRID)).all(axis=1)
    return GRID + movable[:, None] * np.random.default_rng(0).uniform(-4, 4, GRID.shape)


POINTS = jittered()
MESH = triangulate(POINTS)
AHEAD = np.full(len(POINTS), 300.0)


def scene() -> Image:
    """A print on white paper, before a green wall."""
    rng = np.random.default_rng(1)
    image = np.full((*SIZE[::-1], 3), (60, 120, 60), np.uint8)
    x, y, w, h = BOX
    image[y : y + h, x : x + w] = 235
    for _ in range(160):
        px, py = rng.integers((x + 4, y + 4), (x + w - 12, y + h - 10))
        colour = tuple(int(c) for c in rng.integers(0, 200, 3))
        cv2.rectangle(image, (int(px), int(py)), (int(px) + int(rng.integers(2, 9)), int(py) + 4), colour, -1)
    noise = rng.normal(0, 1.5, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.6) + noise, 0, 255).astype(np.uint8)


SCENE = scene()
GREY = premultiplied(np.full((50, 80, 3), (200, 120, 90), np.uint8))


def compositor(placement: Placement | None = None) -> Compositor:
    return Compositor(SCENE, POINTS, MESH, perspective=True, placement=placement)


def paint(work: Compositor, image: Image, picture: Image = GREY, observed: NDArray[np.float64] = POINTS) -> Image:
    return work.paint(image, picture, POINTS, AHEAD, observed)


def inner(margin: int = 4) -> tuple[slice, slice]:
    x, y, w, h = BOX
    return slice(y + margin, y + h - margin), slice(x + margin, x + w - margin)


def test_pixels_outside_the_surface_are_the_same_bits() -> None:
    frame = SCENE.copy()
    painted = paint(compositor(), frame)
    outside = np.ones(SIZE[::-1], bool)
    x, y, w, h = BOX
    outside[y : y + h, x : x + w] = False
    assert np.array_equal(painted[outside], frame[outside])
    assert (painted[inner()] != frame[inner()]).any(axis=-1).mean() > 0.99
    assert np.array_equal(frame, SCENE)  # nor is the frame given changed


@pytest.mark.parametrize("crop", [(0, 1), (1, 0), (1, 1)])
def test_pictures_of_odd_sizes(crop: tuple[int, int]) -> None:
    image = SCENE[: SIZE[1] - crop[0], : SIZE[0] - crop[1]]
    work = Compositor(image, POINTS, MESH, perspective=True)
    assert paint(work, image).shape == image.shape
    assert np.array_equal(paint(work, image)[:40], image[:40])
    assert work.first(GREY).shape == image.shape
    assert all(side % 2 == 0 for side in even(image).shape[:2])


def test_what_is_transparent_changes_nothing() -> None:
    clear = premultiplied(np.dstack([np.full((20, 20, 3), 255, np.uint8), np.zeros((20, 20), np.uint8)]))
    assert np.array_equal(paint(compositor(), SCENE, clear), SCENE)
    assert np.array_equal(paint(compositor(Placement(opacity=0.0)), SCENE), SCENE)


def test_opacity_and_alpha_are_shares() -> None:
    full = paint(compositor(), SCENE)[inner()].astype(float)
    bare = SCENE[inner()].astype(float)
    half = premultiplied(np.dstack([np.full((50, 80, 3), (200, 120, 90), np.uint8), np.full((50, 80), 128, np.uint8)]))
    for seen in (paint(compositor(Placement(opacity=0.5)), SCENE), paint(compositor(), SCENE, half)):
        assert np.abs(seen[inner()] - 0.5 * (full + bare)).max() < 2.5


def test_the_picture_lies_where_it_is_placed() -> None:
    place = (100, 80, 60, 40)
    painted = paint(compositor(Placement(box_corners(place))), SCENE)
    changed = (painted != SCENE).any(axis=-1)
    rows, columns = np.nonzero(changed)
    assert np.abs(np.array((columns.min(), rows.min())) - (100, 80)).max() <= 1  # the edge is smooth
    assert np.abs(np.array((columns.max(), rows.max())) - (159, 119)).max() <= 1
    assert changed[80:120, 100:160].mean() > 0.98


@pytest.mark.parametrize("place", [(0, 0, 40, 40), (300, 200, 500, 500), (-90, 60, 80, 80)])
def test_a_place_off_the_surface_is_refused(place: tuple[int, int, int, int]) -> None:
    with pytest.raises(UsageError, match=r"--place is not on the surface, which is 60 50, 259 50"):
        compositor(Placement(box_corners(place)))


@pytest.mark.parametrize("across", [True, False])
def test_a_fold_stays_a_fold(across: bool) -> None:
    work = compositor()
    still = paint(work, SCENE).astype(float)
    y, x = np.mgrid[: SIZE[1], : SIZE[0]]
    fold = 1 - 0.4 * np.exp(-(((x - 160) if across else (y - 120)) ** 2) / (2 * 12.0**2))
    for share in (0.5, 1.0):
        light = 1 - share * (1 - fold)
        seen = paint(work, np.clip(SCENE * light[..., None], 0, 255).astype(np.uint8)).astype(float)
    ratio = (seen / still).mean(axis=-1)[inner(8)]
    assert np.abs(ratio - fold[inner(8)]).max() < 0.09
    assert np.abs(ratio - fold[inner(8)]).mean() < 0.015


def test_the_print_does_not_shine_through() -> None:
    painted = paint(compositor(), SCENE)[inner(8)].astype(float)
    assert painted.std(axis=(0, 1)).max() < 4


def test_noise_does_not_flicker() -> None:
    work, rng = compositor(), np.random.default_rng(3)
    seen = [paint(work, np.clip(SCENE + rng.normal(0, 3, SCENE.shape), 0, 255).astype(np.uint8)) for _ in range(8)]
    assert np.stack(seen).astype(float)[:, *inner(8)].std(axis=0).mean() < 0.7


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


def test_fine_stripes_become_grey_and_not_moire() -> None:
    stripes = np.zeros((1400, 2000, 3), np.uint8)
    stripes[:, ::6] = stripes[:, 1::6] = stripes[:, 2::6] = 255
    seen = paint(compositor(), SCENE, premultiplied(stripes))[inner(8)].astype(float)
    assert seen.mean() == pytest.approx(0.5 * 235 / 0.95, abs=6)
    assert seen.std(axis=1).max() < 6


def test_points_that_are_seen_carry_the_surface() -> None:
    surface = Surface(POINTS, MESH, box_corners(BOX), None)
    seen = POINTS + np.array((1.5, -1.0))
    some = np.random.default_rng(0).random(len(POINTS)) < 0.6
    corrected = surface.corrected(POINTS, np.where(some[:, None], seen, np.nan))
    assert np.abs(corrected - seen).max() < 0.1
    wild = seen.copy()
    wild[70] += 30
    corrected = surface.corrected(POINTS, wild)
    assert np.linalg.norm(corrected[70] - seen[70]) < 1


def test_a_surface_out_of_view_leaves_the_frame_alone() -> None:
    assert np.array_equal(compositor().paint(SCENE, GREY, POINTS + 900, AHEAD, POINTS + 900), SCENE)


def test_the_first_frame_is_painted_in_its_own_light() -> None:
    lit = np.clip(SCENE * np.linspace(0.6, 1.0, SIZE[0])[None, :, None], 0, 255).astype(np.uint8)
    painted = Compositor(lit, POINTS, MESH, perspective=True).first(GREY).astype(float)
    assert np.array_equal(painted[:40], lit[:40])
    left, right = painted[80:160, 75:95].mean(), painted[80:160, 225:245].mean()
    assert left / right == pytest.approx((0.6 + 0.4 * 85 / 319) / (0.6 + 0.4 * 235 / 319), abs=0.05)
