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
