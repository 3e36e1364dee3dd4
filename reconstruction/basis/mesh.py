"""Triangle meshes over scattered points: Delaunay, unique edges, coarse versions, barycentric location (paper §3.1)."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask

if TYPE_CHECKING:
    from scipy.sparse import csr_array

# Triangles on the border bridge a dent of the outline, where nothing is seen, if they have
SLIVER_DEGREES = 10.0  # a smaller angle, or
LONG_SIDE = 4.0  # a side so many times as long as half of those at either end are at most, and half of all
FAR_OFF = 3.0  # usual edges from what goes with the rest to what does not
CHANCE = 3.0  # standard deviations of a count that come about by chance


@dataclass(frozen=True)
class Mesh:
    """Connectivity only; the vertices move.

    Attributes:
        faces: (m, 3) vertex indices, counter-clockwise in the plane they were triangulated in.
        edges: (n, 2) unique vertex pairs, smaller index first.
    """

    faces: Indices
    edges: Indices

    @cached_property
    def vertices(self) -> Indices:
        """The points (n,) that it has triangles at, ascending."""
        return np.unique(self.faces)

    def alone(self) -> "Mesh":
        """The same of its `vertices` only, which are numbered anew."""
        return mesh_from_faces(np.searchsorted(self.vertices, self.faces))


def unique_edges(faces: Indices) -> Indices:
    """Each edge of the triangles (m, 3) once, as (n, 2) pairs with the smaller index first."""
    return np.unique(sides(faces), axis=0)


def sides(faces: Indices) -> Indices:
    """The sides (3 m, 2) of triangles (m, 3), one triangle's after the other's, smaller index first."""
    return np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)


def mesh_from_faces(faces: Indices) -> Mesh:
    """A mesh of the given triangles (m, 3)."""
    faces = np.asarray(faces, np.int64)
    return Mesh(faces, unique_edges(faces))


def triangulate(points: Array) -> Mesh:
    """Delaunay mesh of points (p, 2).

    Raises:
        ReconstructionError: fewer than 3 points, or all on one line.
    """
    if len(points) < 3:
        raise ReconstructionError(f"cannot make a mesh of {len(points)} points: at least 3 are needed")
    from scipy.spatial import Delaunay, QhullError  # takes its time to load, and who only draws needs none

    try:
        triangulation = Delaunay(points)
    except QhullError as error:
        raise ReconstructionError("cannot make a mesh: the points lie on one line, or move at random") from error
    faces = triangulation.simplices.astype(np.int64)
    return mesh_from_faces(without_bridges(points, faces))


def without_bridges(points: Array, faces: Indices) -> Indices:
    """Triangles (m, 3) over points (p, 2), bridges on the border peeled off, one after the other.

    The points' shortest tree stays in the mesh, so no point is lost, and it does not fall into pieces.
    """
    edges, side = np.unique(sides(faces), axis=0, return_inverse=True)
    length = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    side, tree = side.reshape(-1, 3), in_shortest_tree(length, edges, len(points))
    bridges = long_sides(length, edges, len(points))[side].any(axis=1)
    bridges |= smallest_angle(points, faces) < np.deg2rad(SLIVER_DEGREES)
    left = np.flatnonzero(bridges)
    kept = np.ones(len(faces), np.bool_)
    while True:
        left = left[kept[left]]
        border = np.bincount(side[kept].ravel())[side[left]] == 1
        out = left[border.any(axis=1) & ~(border & tree[side[left]]).any(axis=1)]
        if not len(out):
            return faces[kept]
        first = np.full(len(points), len(faces))
        np.minimum.at(first, faces[out], out[:, None])  # one at a time around each point
        kept[out[(first[faces[out]] == out[:, None]).all(axis=1)]] = False


def in_shortest_tree(length: Array, edges: Indices, points: int) -> Mask:
    """Which edges (n, 2), sorted, of such lengths (n,) are in the shortest spanning tree of so many points."""
    from scipy.sparse import csr_array  # takes its time to load, and who only draws needs none
    from scipy.sparse.csgraph import minimum_spanning_tree

    tree = minimum_spanning_tree(csr_array((length.clip(1e-300), edges.T), shape=(points, points))).tocoo()
    inside = np.zeros(len(edges), np.bool_)
    i, j = np.sort([tree.row, tree.col], axis=0).astype(np.int64)
    inside[np.searchsorted(edges @ [points, 1], i * points + j)] = True
    return inside


def long_sides(length: Array, edges: Indices, points: int) -> Mask:
    """Which edges (n, 2), of such lengths (n,), between so many points are much longer than those around."""
    ends, both = edges.ravel(), np.repeat(length, 2)
    count = np.bincount(ends, minlength=points)
    half = np.cumsum(count) - count + (count.clip(1) - 1) // 2  # of each point's edges, shortest first
    usual = both[np.lexsort((both, ends))][half.clip(None, len(both) - 1)]
    return np.asarray(length > LONG_SIDE * usual[edges].max(axis=1).clip(np.median(length)))


def boundary(faces: Indices) -> Indices:
    """Edges (n, 2) that belong to one of the triangles (m, 3) only."""
    edges, count = np.unique(sides(faces), axis=0, return_counts=True)
    return np.asarray(edges[count == 1], np.int64)


def without_strays(mesh: Mesh, shape: Array, seen: Mask) -> Mesh:
    """A mesh over a shape (3, p) without those vertices at its border that are beside it.

    Where the surface's contour crosses another is a corner to whoever follows corners, but it goes with neither: it is seen
    (K, p) much more seldom than those around. One or two alone are far off.
    """
    count = seen.sum(axis=0).astype(float)
    around = neighbour_averages(mesh, len(count)) @ count
    stray = np.zeros(len(count), np.bool_)
    stray[boundary(mesh.faces)] = True
    stray &= (around - count > CHANCE * np.sqrt(around)) | on_islet(mesh, shape)
    faces = mesh.faces[~stray[mesh.faces].any(axis=1)]
    return mesh_from_faces(faces) if stray.any() and len(faces) else mesh


def on_islet(mesh: Mesh, shape: Array) -> Mask:
    """Which vertices (p,) of a shape (3, p), one or two, have all others further away than `FAR_OFF` usual edges."""
    from scipy.sparse import csr_array  # takes its time to load, and who only draws needs none
    from scipy.sparse.csgraph import connected_components

    a, b = mesh.edges.T
    length, p = np.linalg.norm(shape[:, a] - shape[:, b], axis=0), shape.shape[1]
    near = length <= FAR_OFF * np.median(length)
    island = connected_components(csr_array((near[near], (a[near], b[near])), shape=(p, p)), directed=False)[1]
    return np.asarray(np.bincount(island)[island] < 3)


def neighbour_averages(mesh: Mesh, vertices: int) -> "csr_array":
    """A matrix (p, p) that replaces each vertex's value by the mean of its neighbours', 0 where it has none."""
    from scipy.sparse import csr_array  # takes its time to load, and who only draws needs none

    a, b = mesh.edges.T
    degree = np.maximum(np.bincount(mesh.edges.ravel(), minlength=vertices), 1).astype(float)
    rows, columns = np.concatenate([a, b]), np.concatenate([b, a])
    return csr_array((1.0 / degree[rows], (rows, columns)), shape=(vertices, vertices))


def smallest_angle(points: Array, faces: Indices) -> Array:
    """Smallest angle (m,) in radians of each triangle with corners points (p, d)."""
    corners = points[faces]
    lengths = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    a, b, c = np.sort(lengths, axis=1).T
    return np.arccos(np.clip((b * b + c * c - a * a) / np.maximum(2 * b * c, 1e-300), -1, 1))


def vertex_normals(vertices: Array, faces: Indices) -> Array:
    """Unit normals (p, 3) of vertices (p, 3), of the triangles (m, 3) around each by their areas; 0 where there is none."""
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    summed = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(summed, faces[:, corner], area)
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    return np.asarray(summed / np.where(length > 0, length, 1.0))


def farthest_points(points: Array, count: int) -> Indices:
    """Indices of `count` well-spread points of (p, d), farthest-first, starting at the one farthest from the centroid."""
    distance = np.linalg.norm(points - points.mean(axis=0), axis=1)
    chosen = [int(distance.argmax())]
    nearest = np.linalg.norm(points - points[chosen[0]], axis=1)
    for _ in range(min(count, len(points)) - 1):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)


def locate(points: Array, mesh: Mesh, queries: Array) -> tuple[Indices, Array]:
    """Where queries (n, 2) lie in the mesh over points (p, 2).

    Returns:
        face (n,) index of the triangle, −1 outside; weights (n, 3) barycentric coordinates in it.
    """
    a, b, c = (points[mesh.faces[:, k]] for k in range(3))
    face = np.full(len(queries), -1)
    weights = np.zeros((len(queries), 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / cross2(b - a, c - a)
        for i, q in enumerate(queries):
            w = np.stack([cross2(b - q, c - q), cross2(c - q, a - q), cross2(a - q, b - q)], axis=1) * inverse[:, None]
            inside = np.flatnonzero((w >= -1e-9).all(axis=1))
            if inside.size:
                face[i], weights[i] = inside[0], w[inside[0]]
    return face, weights


def cross2(a: Array, b: Array) -> Array:
    """Cross product (n,) of plane vectors (n, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def ratio_of_sizes(shape: Array, other: Array) -> float:
    """How many times as long the edges of a shape (3, p) are as those of another (3, p), in the mean of logarithms."""
    i, j = edges_in_main_plane(other).T
    lengths = [np.linalg.norm(S[:, i] - S[:, j], axis=0) for S in (shape, other)]
    good = (lengths[0] > 0) & (lengths[1] > 0)
    return float(np.exp(np.mean(np.log(lengths[0][good] / lengths[1][good]))))


def edges_in_main_plane(shape: Array) -> Indices:
    """Edges (n, 2) of a shape's points (3, p), triangulated in its main plane."""
    centred = shape - shape.mean(axis=1, keepdims=True)
    return unique_edges(triangulate((np.linalg.svd(centred, full_matrices=False)[0][:, :2].T @ centred).T).faces)
