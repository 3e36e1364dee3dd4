"""Sheets are bent, never stretched, but for a curtain and cloth in the wind."""

import numpy as np
import pytest

from app.synthetic.catalog import KINDS
from app.synthetic.scene import scene

STRETCHING = ("curtain", "cloth", "flag", "towel", "blanket")
FOLDED = ("crease", "book")  # a step of the chain that is made lies across the crease
SHEETS = [name for name, kind in KINDS.items() if kind.what == "sheet" and name not in STRETCHING]


@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.parametrize("frame", [0, 47])
def test_lines_keep_their_lengths(name: str, frame: int) -> None:
    rng = np.random.default_rng(frame)
    for _ in range(3):
        begin, end = rng.uniform(-0.5, 0.5, (2, 2)) * (1, 0.75)
        line = begin + np.linspace(0, 1, 300_001)[:, None] * (end - begin)
        points = scene(name, 3).shape(line, frame / 119)
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        assert length == pytest.approx(np.hypot(*(end - begin)), rel=1e-4 if name in FOLDED else 1e-6)


@pytest.mark.parametrize("name", SHEETS)
def test_they_bend(name: str) -> None:
    x = np.linspace(-0.5, 0.5, 9)
    places = np.column_stack([np.tile(x, 9), np.repeat(0.75 * x, 9)])
    shapes = [scene(name, 3).shape(places, time) for time in np.linspace(0, 1, 7)]
    relief = [np.linalg.svd(shape - shape.mean(axis=0), compute_uv=False)[2] for shape in shapes]
    assert max(relief) > 0.05 * np.sqrt(len(places)) * 0.3


def test_a_curtain_stretches_and_moves_least_at_its_rod() -> None:
    shape = scene("curtain", 3).shape
    down = np.column_stack([np.zeros(9), np.linspace(-0.375, 0.375, 9)])
    moved = np.stack([shape(down, time) for time in np.linspace(0, 1, 60)])
    lengths = np.linalg.norm(moved[:, 8] - moved[:, 0], axis=1) / 0.75
    assert lengths.max() == pytest.approx(1.03, abs=0.005)
    assert lengths.min() == pytest.approx(0.97, abs=0.005)
    deep = moved[..., 2].std(axis=0)
    assert deep[8] > 2 * deep[0] > 0


def test_torn_paper_keeps_its_lengths_and_parts_above_where_it_is_torn() -> None:
    torn = scene("tear", 3).shape
    down = np.column_stack([np.full(1001, 0.2), np.linspace(-0.375, 0.375, 1001)])
    lengths = [np.linalg.norm(np.diff(torn(down, time), axis=0), axis=1).sum() for time in (0.0, 1.0)]
    assert lengths == pytest.approx([0.75, 0.75], rel=1e-5)
    left, right = (torn(np.array([[x, y] for y in (-0.375, 0.3)]), 1.0) for x in (-1e-3, 1e-3))
    above, below = np.linalg.norm(left - right, axis=1)
    assert above > 0.2
    assert below < 0.01


def test_rubber_is_drawn_out() -> None:
    rubber = scene("rubber", 3).shape
    ends = np.array([[-0.5, 0.0], [0.5, 0.0]])
    lengths = [np.ptp(rubber(ends, time), axis=0)[0] for time in np.linspace(0, 1, 30)]
    assert max(lengths) > 1.3 * min(lengths)
