"""Groups of points by tracks that are made up."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tracking.region.groups import groups_of

Array = NDArray[np.float64]
FRAMES = 20
EXTENT = 400.0


def grid(step: float = 16.0, noise: float = 3.0) -> Array:
    x, y = np.meshgrid(np.arange(10, EXTENT, step), np.arange(10, 300, step))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    return points + np.random.default_rng(0).uniform(-noise, noise, points.shape)


def tracks(points: Array, way: Array, noise_px: float = 0.2) -> Array:
    """Points that go the way (P, 2) px in a sine's quarter, with noise."""
    time = np.sin(np.linspace(0, np.pi / 2, FRAMES))[:, None, None]
    W = points + time * way + np.random.default_rng(1).normal(0, noise_px, (FRAMES, *points.shape))
    W[0] = points
    return W


def test_what_moves_before_a_still_wall_is_a_group_of_its_own() -> None:
    points = grid()
    sheet = (np.abs(points - [200, 150]) < [90, 70]).all(axis=1)
    found = groups_of(tracks(points, np.where(sheet[:, None], [12.0, 5.0], 0.0)), EXTENT)
    assert len(found.motion_px) == 2
    assert (found.label[~sheet] == 0).mean() > 0.95
    assert (found.label[sheet] == 1).mean() > 0.8  # its corners are beside four others at most
    np.testing.assert_allclose(found.motion_px, [0.4, 13.0], atol=0.6)


def test_a_point_of_the_wall_that_is_alone_beside_what_moves_does_not_join_it() -> None:
    """All its neighbours are on one side, where any motion is explained by a steep slope."""
    points = grid()
    sheet = (np.abs(points - [200, 150]) < [90, 70]).all(axis=1)
    alone = np.array([[315.0, y] for y in (100, 150, 200)])
    points = np.concatenate([points[sheet], alone])
    own = np.arange(len(points)) < sheet.sum()
    found = groups_of(tracks(points, np.where(own[:, None], [0.0, 30.0], 0.0)), EXTENT)
    assert (found.label[own] == 0).mean() > 0.8
    assert (found.label[~own] == -1).all()


def test_a_surface_that_turns_shrinks_and_bends_is_one_group() -> None:
    points = grid()
    x, y = ((points - [200, 150]) / 200).T
    way = np.stack([30 * y - 40 * x + 25 * x**2, -30 * x + 30 * np.sin(3 * x)], axis=1)
    found = groups_of(tracks(points, way), EXTENT)
    assert len(found.sizes) == 1
    assert found.sizes[0] > 0.8 * len(points)


def test_two_things_that_move_otherwise_are_two_groups_and_gaps_in_tracks_do_no_harm() -> None:
    points = grid()
    left = points[:, 0] < 200
    W = tracks(points, np.where(left[:, None], [0.0, 15.0], [0.0, -10.0]))
    W[5:12, ::7] = np.nan
    found = groups_of(W, EXTENT)
    assert len(found.motion_px) == 2
    for side in (left, ~left):
        assert np.unique(found.label[side & (found.label >= 0)]).size == 1
    assert (found.label < 0).mean() < 0.1


def test_points_that_are_hardly_seen_are_in_no_group() -> None:
    points = grid()
    W = tracks(points, np.full(points.shape, 6.0))
    W[4:, ::5] = np.nan
    label = groups_of(W, EXTENT).label
    assert (label[::5] == -1).all()
    assert (np.delete(label, np.s_[::5]) == 0).all()


def test_too_few_points_are_no_group() -> None:
    points = grid()[:10]
    found = groups_of(tracks(points, np.full(points.shape, 6.0)), EXTENT)
    assert (found.label == -1).all()
    assert found.sizes.size == 0


@pytest.mark.parametrize("name", ["waving_3", "waving_5", "flag250_perspective", "flag250"])
def test_sheets_that_wave_are_not_torn(shared_data: Path, name: str) -> None:
    W = np.load(shared_data / f"{name}.npz")["W"].transpose(0, 2, 1)[::4]
    found = groups_of(W, float(np.ptp(W[0], axis=0).max()))
    assert found.sizes[0] > 0.8 * W.shape[1]


def test_a_sheet_that_is_held_at_one_side_is_not_its_background() -> None:
    """Where it is held both stay: no motion is torn there."""
    points = grid(8.0, 1.5)
    sheet = (np.abs(points - [200, 150]) < [120, 80]).all(axis=1)
    swing = ((points[:, 0] - 80) / 240).clip(0) ** 2 * 30
    found = groups_of(tracks(points, np.where(sheet, swing, 0.0)[:, None] * [0.0, 1.0]), EXTENT)
    outer = sheet & (points[:, 0] > 200)
    assert (found.label[~sheet] == 0).mean() > 0.9
    assert (found.label[outer] == 1).mean() > 0.8


def test_the_axis_of_a_sheet_that_turns_is_a_part_of_it() -> None:
    points = grid()
    found = groups_of(tracks(points, (points - [200, 150]) * [-0.06, 0.0]), EXTENT)
    assert len(found.sizes) == 1
    assert found.sizes[0] > 0.9 * len(points)
