import numpy as np
import pytest

from app.painting.compositing import Compositor, even
from app.painting.picture import premultiplied
from app.painting.placement import Placement, box_corners
from app.painting.surface import Surface
from app.terminal.errors import UsageError
from tests.app.painting.scene import AHEAD, BOX, GREY, MESH, POINTS, SCENE, SIZE, compositor, inner, paint


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
