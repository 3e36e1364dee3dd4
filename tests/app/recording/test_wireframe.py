import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.recording.wireframe import Strips, edge_strips
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


def test_strips_go_through_the_points() -> None:
    points = np.array([[0, 0], [1, 2], [3, 4], [5, 6]], np.float32)
    strips = Strips(np.array([[0, 1], [1, 2], [1, 3]]))
    drawn = strips.through(points).to_pylist()
    assert drawn == [points[strip].tolist() for strip in strips.strips]
    assert len(drawn) == 2
