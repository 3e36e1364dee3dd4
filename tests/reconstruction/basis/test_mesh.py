"""Triangulation, unique edges, location in triangles, well-spread points."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import ConvexHull, Delaunay

from reconstruction import ReconstructionError
from reconstruction.arrays import Array
from reconstruction.basis.distances import manhattan
from reconstruction.basis.mesh import (
    Mesh,
    cross2,
    farthest_points,
    locate,
    mesh_from_faces,
    smallest_angle,
    triangulate,
    unique_edges,
    without_strays,
)
from tests.reconstruction.world import SEEDS, spread

SIZES = st.integers(4, 60)


def lifted(points: Array) -> Array:
    """Points (p, 2) of a plane as a shape (3, p)."""
    return np.pad(points.T, ((0, 1), (0, 0)))


@given(SEEDS, SIZES)
def test_every_edge_of_a_triangle_is_there_once(rng: np.random.Generator, count: int) -> None:
    faces = np.array([rng.choice(20, 3, replace=False) for _ in range(count)])
    edges = unique_edges(faces)
    expected = {tuple(sorted((int(f[i]), int(f[i - 1])))) for f in faces for i in range(3)}
    assert [tuple(e) for e in edges.tolist()] == sorted(expected)


@given(SEEDS, SIZES)
def test_triangulation_is_a_planar_mesh_of_all_points(rng: np.random.Generator, p: int) -> None:
    points = spread(rng, p).T
    mesh = triangulate(points)
    assert np.array_equal(np.unique(mesh.faces), np.arange(p))
    assert p - len(mesh.edges) + len(mesh.faces) == 1  # Euler: a disk without holes
    a, b, c = (points[mesh.faces[:, k]] for k in range(3))
    area = cross2(b - a, c - a) / 2
    assert (area > 0).all()
    assert area.sum() <= ConvexHull(points).volume * (1 + 1e-9)
    np.testing.assert_array_equal(mesh.edges, unique_edges(mesh.faces))


def test_slivers_that_bridge_a_dent_are_dropped() -> None:
    points = np.array([[0.0, 0], [5, 0.1], [10, 0], [10, 5], [5, 5], [0, 5]])
    assert [0, 1, 2] in np.sort(Delaunay(points).simplices).tolist()
    faces = triangulate(points).faces
    assert [0, 1, 2] not in np.sort(faces).tolist()
    assert np.unique(faces).size == len(points)


def test_slivers_behind_slivers_are_dropped_too() -> None:
    dent = np.array([[0.0, 0], [2, 0.3], [5, 0.5], [8, 0.3], [10, 0]])  # bridged by one wide triangle and two thin ones
    points = np.concatenate([dent, [[10, 6], [5, 6], [0, 6]]])
    faces = np.sort(triangulate(points).faces)
    assert not (faces < len(dent)).all(axis=1).any()
    assert np.unique(faces).size == len(points)


def test_long_triangles_that_bridge_a_dent_are_dropped() -> None:
    x, y = np.meshgrid(np.arange(11.0), np.arange(6.0))
    beside = (y == 0) | (np.abs(x - 5) > 2)
    points = np.stack([x[beside], y[beside]], axis=1)
    mesh = triangulate(points)
    assert np.linalg.norm(points[mesh.edges[:, 0]] - points[mesh.edges[:, 1]], axis=1).max() < 5  # the dent is 6 wide
    assert np.array_equal(mesh.vertices, np.arange(len(points)))


def test_parts_with_few_points_stay_in_the_mesh() -> None:
    x, y = np.meshgrid(np.concatenate([np.arange(0, 10.0), np.arange(10.0, 40, 6)]), np.arange(0.0, 19, 6))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    points[:, 1] += 1e-3 * points[:, 0] * (points[:, 0] - 34)  # no outline is straight
    faces = triangulate(points).faces
    assert (points[faces, 0].max(axis=1) > 33).any()
    assert np.array_equal(np.unique(faces), np.arange(len(points)))


def test_parts_far_from_each_other_stay_in_one_piece() -> None:
    x, y = np.meshgrid(np.concatenate([np.arange(6.0), np.arange(20.0, 26)]), np.arange(6.0))
    points = np.stack([x.ravel(), y.ravel()], axis=1)
    mesh = triangulate(points)
    manhattan(np.pad(points.T, ((0, 1), (0, 0))), mesh.edges)  # else raises
    assert np.count_nonzero(np.ptp(points[mesh.faces, 0], axis=1) > 10) < 3


@given(SEEDS)
def test_no_point_is_lost_with_the_slivers(rng: np.random.Generator) -> None:
    points = spread(rng, 40).T * (1.0, 1e-3)
    assert np.unique(triangulate(points).faces).size == len(points)


def test_smallest_angle_of_known_triangles() -> None:
    points = np.array([[0.0, 0], [1, 0], [0, 1], [0.5, np.sqrt(3) / 2], [2, 0]])
    angles = np.rad2deg(smallest_angle(points, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])))
    np.testing.assert_allclose(angles, [45, 60, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("points", "words"),
    [(np.zeros((2, 2)), "2 points"), (np.stack([np.arange(5.0), 2 * np.arange(5.0)], axis=1), "on one line")],
)
def test_points_without_a_mesh_are_refused(points: np.ndarray, words: str) -> None:
    with pytest.raises(ReconstructionError, match=words):
        triangulate(points)


@given(SEEDS)
def test_points_are_located_where_their_weights_say(rng: np.random.Generator) -> None:
    points = spread(rng, 30).T
    mesh = triangulate(points)
    chosen = rng.integers(len(mesh.faces), size=25)
    weights = rng.dirichlet(np.ones(3), 25)
    queries = np.einsum("nkd,nk->nd", points[mesh.faces[chosen]], weights)
    face, found = locate(points, mesh, queries)
    assert (face >= 0).all()
    assert (found >= -1e-6).all()
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("nkd,nk->nd", points[mesh.faces[face]], found), queries, atol=1e-8)
    inner = weights.min(axis=1) > 1e-6
    np.testing.assert_array_equal(face[inner], chosen[inner])


def test_vertices_are_inside_and_far_points_are_not() -> None:
    points = np.array([[0.0, 0], [4, 0], [0, 4], [4, 4]])
    mesh = triangulate(points)
    face, weights = locate(points, mesh, np.concatenate([points, [[9.0, 9.0], [-1.0, 2.0], [np.nan, 0.0]]]))
    assert (face[:4] >= 0).all()
    np.testing.assert_allclose(weights[:4].max(axis=1), 1.0)
    np.testing.assert_array_equal(face[4:], -1)


def test_either_winding_can_be_located_in() -> None:
    points = np.array([[0.0, 0], [4, 0], [0, 4]])
    for face in ([0, 1, 2], [0, 2, 1]):
        found, weights = locate(points, mesh_from_faces(np.array([face])), np.array([[1.0, 1.0]]))
        assert found.tolist() == [0]
        np.testing.assert_allclose(weights[0] @ points[face], [1.0, 1.0])


@given(SEEDS, st.integers(1, 12))
def test_farthest_points_are_distinct_and_far_apart(rng: np.random.Generator, count: int) -> None:
    points = rng.normal(size=(40, 3))
    chosen = farthest_points(points, count)
    assert len(set(chosen.tolist())) == count
    apart = np.linalg.norm(points[chosen[:, None]] - points[chosen], axis=2)[np.triu_indices(count, 1)]
    cover = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(axis=1).max()
    assert not apart.size or apart.min() >= cover - 1e-12  # what farthest-first promises


def test_no_more_points_than_there_are() -> None:
    assert sorted(farthest_points(np.eye(3), 10).tolist()) == [0, 1, 2]


def test_mesh_of_faces_has_their_edges() -> None:
    mesh = mesh_from_faces(np.array([[2, 1, 0]], np.int32))
    assert isinstance(mesh, Mesh)
    assert mesh.faces.dtype == np.int64
    assert mesh.edges.tolist() == [[0, 1], [0, 2], [1, 2]]


def test_vertices_at_the_border_that_are_hardly_ever_seen_are_left_out() -> None:
    rng = np.random.default_rng(0)
    points = np.stack(np.meshgrid(np.arange(8.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    beside = np.array([[9.0, 2.4], [3.3, 2.6]])  # out on the right, and within
    points = np.concatenate([points, beside])
    mesh = triangulate(points)
    seen = rng.random((30, 50)) < 0.95
    seen[:, 48:] = rng.random((30, 2)) < 0.1
    left = without_strays(mesh, lifted(points), seen)
    assert set(range(50)) - set(left.vertices.tolist()) == {48}
    assert set(map(tuple, left.faces.tolist())) < set(map(tuple, mesh.faces.tolist()))


@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
def test_vertices_that_are_missing_by_chance_stay(share: float) -> None:
    rng = np.random.default_rng(0)
    points = rng.random((200, 2))
    left = without_strays(triangulate(points), lifted(points), rng.random((30, 200)) < share)
    assert len(left.vertices) == 200


@pytest.mark.parametrize(("off", "stays"), [(2.5, True), (8.0, False)])
def test_two_vertices_far_away_from_all_are_left_out(off: float, *, stays: bool) -> None:
    points = np.stack(np.meshgrid(np.arange(8.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    points = np.concatenate([points, [[7 + off, 2.4], [8 + off, 2.1]]])
    left = without_strays(triangulate(points), lifted(points), np.ones((30, 50), np.bool_))
    assert [p in left.vertices for p in (48, 49)] == [stays, stays]
    assert set(range(48)) <= set(left.vertices.tolist())


def test_a_part_that_turns_away_stays() -> None:
    points = np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1).reshape(-1, 2)
    mesh = triangulate(points)
    seen = np.ones((30, 54), np.bool_)
    seen[8:, points[:, 0] > 4] = False
    assert np.array_equal(without_strays(mesh, lifted(points), seen).faces, mesh.faces)


def test_a_mesh_alone_has_its_vertices_only() -> None:
    mesh = mesh_from_faces(np.array([[2, 5, 7], [5, 8, 7]]))
    assert mesh.vertices.tolist() == [2, 5, 7, 8]
    assert mesh.alone().faces.tolist() == [[0, 1, 2], [1, 3, 2]]
