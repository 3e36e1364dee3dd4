import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.recording.wireframe import edge_strips, line_strips
from reconstruction.basis.mesh import triangulate


@given(st.sets(st.tuples(st.integers(0, 12), st.integers(0, 12)).filter(lambda e: e[0] < e[1]), min_size=1))
def test_strips_run_along_every_edge_exactly_once(pairs: set[tuple[int, int]]) -> None:
    strips = edge_strips(np.array(sorted(pairs)))
    walked = [tuple(sorted(step)) for s in strips for step in zip(s[:-1].tolist(), s[1:].tolist(), strict=True)]
    assert sorted(walked) == sorted(pairs)


def test_a_mesh_needs_few_strips() -> None:
    points = np.random.default_rng(0).random((800, 2))
    edges = triangulate(points).edges
    assert sum(map(len, edge_strips(edges))) < 1.15 * len(edges)


def test_line_strips_keep_their_points() -> None:
    points = np.array([[0, 0], [1, 2], [3, 4]], np.float32)
    strips = line_strips(points, [np.array([0, 1, 2]), np.array([2, 0])]).strips
    assert strips is not None
    assert strips.as_arrow_array().to_pylist() == [[[0, 0], [1, 2], [3, 4]], [[3, 4], [0, 0]]]
