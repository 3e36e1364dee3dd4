"""Strain and curvature of a surface, vertex by vertex: what mechanics asks for."""

import numpy as np

from reconstruction.arrays import Array, Indices

NEIGHBOURS = 18  # of a vertex, through which a quadric is laid


class Surface:
    """A rest shape that others are compared with.

    Args:
        rest: (3, p).
        faces: (m, 3).
    """

    def __init__(self, rest: Array, faces: Indices) -> None:
        self._faces = faces
        self._rest_inverse, self._area = inverses(flattened(rest, faces))
        from scipy.spatial import cKDTree  # takes its time to load, and few ask

        near = cKDTree(rest.T).query(rest.T, min(NEIGHBOURS + 1, rest.shape[1]))[1]
        self._near: Indices = np.asarray(near, np.int64)

    def strain(self, shape: Array) -> Array:
        """Largest principal strain (p,) of a shape (3, p): 0.02 is 2 % longer than at rest, in the direction of most.

        Of the triangles around each vertex, by their areas at rest. NaN where there is no triangle, and of a shape of NaN.
        """
        if np.isnan(shape).any():
            return np.full(shape.shape[1], np.nan)
        gradient = flattened(shape, self._faces) @ self._rest_inverse
        largest = np.linalg.svd(gradient, compute_uv=False)[:, 0] - 1
        summed, weight = np.zeros((2, shape.shape[1]))
        for k in range(3):
            np.add.at(summed, self._faces[:, k], self._area * largest)
            np.add.at(weight, self._faces[:, k], self._area)
        with np.errstate(invalid="ignore"):
            return np.asarray(summed / weight)

    def curvature(self, shape: Array) -> Array:
        """Mean curvature (p,) of a shape (3, p) in camera axes, one over its units; positive where it bulges to the camera.

        By the quadric that is nearest to a vertex and its neighbours; NaN of a shape of NaN.
        """
        if np.isnan(shape).any():
            return np.full(shape.shape[1], np.nan)
        near = shape.T[self._near]
        away = near - near.mean(axis=1, keepdims=True)
        axes = np.linalg.svd(away, full_matrices=False)[2]  # rows: two in the plane, and the normal
        normal = np.where(axes[:, 2, 2:] > 0, -axes[:, 2], axes[:, 2])  # to the camera
        x, y = (np.einsum("pkd,pd->pk", near - shape.T[:, None], axes[:, k]) for k in (0, 1))
        z = np.einsum("pkd,pd->pk", near - shape.T[:, None], normal)
        A = np.stack([x**2 / 2, x * y, y**2 / 2, x, y, np.ones_like(x)], axis=2)
        size = np.sqrt((x**2 + y**2).mean(axis=1))
        unit = np.stack([size**2] * 3 + [size] * 2 + [np.ones_like(size)], axis=1)
        A = A / unit[:, None]
        gram = np.einsum("pki,pkj->pij", A, A) + 1e-9 * np.eye(6)
        a, b, c, d, e, _ = (np.linalg.solve(gram, np.einsum("pki,pk->pi", A, z)[..., None])[..., 0] / unit).T
        return np.asarray(-((1 + e**2) * a - 2 * d * e * b + (1 + d**2) * c) / (2 * (1 + d**2 + e**2) ** 1.5))


def flattened(shape: Array, faces: Indices) -> Array:
    """Two edges of each triangle in its own plane, (m, 2, 2): columns are edges."""
    a, b, c = (shape.T[faces[:, k]] for k in range(3))
    along, other = b - a, c - a
    length = np.linalg.norm(along, axis=1)
    x = along / np.where(length > 0, length, 1.0)[:, None]
    part = (other * x).sum(axis=1)
    rest = np.linalg.norm(other - part[:, None] * x, axis=1)
    return np.stack([np.stack([length, part], axis=1), np.stack([np.zeros_like(rest), rest], axis=1)], axis=1)


def inverses(edges: Array) -> tuple[Array, Array]:
    """Inverses (m, 2, 2) of edges (m, 2, 2), and areas (m,) of their triangles; 0 of those that have hardly any."""
    area = edges[:, 0, 0] * edges[:, 1, 1] / 2
    good = area > 1e-9 * area.max()
    return np.linalg.inv(np.where(good[:, None, None], edges, np.eye(2))), np.where(good, area, 0.0)
