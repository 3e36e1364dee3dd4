"""What moves, among groups of points."""

import numpy as np

from tests.tracking.region.test_groups import EXTENT, grid, tracks
from tracking.region.groups import groups_of
from tracking.region.surface import surfaces


def test_what_leaves_a_still_wall_is_found_though_it_is_in_pieces_too_small_for_a_group() -> None:
    points = grid()
    sheet = (np.abs(points - [200, 150]) < [50, 50]).all(axis=1)
    pieces = np.digitize(points[:, 0], [180, 200, 220])
    way = np.array([[-30.0, 12.0], [25.0, 30.0], [-8.0, -35.0], [30.0, -20.0]])[pieces]
    W = tracks(points, np.where(sheet[:, None], way, 0.0))
    assert len(groups_of(W, EXTENT).motion_px) == 1
    (found,) = surfaces(W, np.full((300, 400), 255, np.uint8))
    assert found.own[sheet].mean() > 0.8
    assert not found.own[~sheet].any()
    x, y, w, h = found.box
    assert 120 < x < 200 < x + w < 280
    assert 70 < y < 150 < y + h < 230


def test_nothing_is_found_where_nothing_moves() -> None:
    points = grid()
    assert surfaces(tracks(points, np.zeros_like(points)), np.full((300, 400), 255, np.uint8)) == []


def test_what_is_at_the_picture_s_border_is_behind_what_is_not_whichever_moves_more() -> None:
    points = grid()
    sheet = (np.abs(points - [200, 150]) < [90, 70]).all(axis=1)
    W = tracks(points, np.where(sheet[:, None], [-14.0, 5.0], [30.0, 0.0]))
    found, *others = surfaces(W, np.full((300, 400), 255, np.uint8))
    assert found.own[sheet].mean() > 0.8
    assert not found.own[~sheet].any()
    assert [other.own[~sheet].mean() > 0.8 for other in others] == [True]


def test_a_small_part_that_hangs_together_is_not_all_that_leaves_a_wall() -> None:
    """A face of which only the mouth has texture enough to be one group."""
    points = grid(step=12.0, noise=2.0)
    sheet = (np.abs(points - [200, 150]) < [70, 70]).all(axis=1)
    part = (np.abs(points - [200, 185]) < [28, 30]).all(axis=1)
    way = np.random.default_rng(3).normal((26.0, 10.0), 7.0, points.shape)
    way[part], way[~sheet] = (26.0, 10.0), 0.0
    W = tracks(points, way)
    groups = groups_of(W, EXTENT)
    assert groups.sizes[1:].max(initial=0) < 0.4 * sheet.sum()
    found = surfaces(W, np.full((300, 400), 255, np.uint8))[0]
    assert found.own[sheet].mean() > 0.6
    assert not found.own[~sheet].any()


def test_a_sheet_that_fills_the_picture_is_the_surface_though_it_is_at_the_border() -> None:
    points = grid()
    x, y = ((points - [200, 150]) / 200).T
    W = tracks(points, np.stack([30 * y - 40 * x + 25 * x**2, -30 * x + 30 * np.sin(3 * x)], axis=1))
    (found,) = surfaces(W, np.full((300, 400), 255, np.uint8))
    assert found.own.mean() > 0.8
