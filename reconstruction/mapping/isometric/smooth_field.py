"""Smooth functions on the points of one image: what depths and image positions of a bending sheet are made of."""

from dataclasses import dataclass

import numpy as np

from reconstruction.arrays import Array


@dataclass(frozen=True)
class SmoothField:
    """The affine functions 1, x, y and the leading eigenfunctions of the thin-plate kernel over m nodes.

    The eigenfunctions are defined everywhere: u_k(x) = √m (Σ_i w_ik |x − x_i|² log|x − x_i| + affine part), with unit
    mean square over the nodes. Coordinates are centred and in units of the nodes' RMS radius.

    Attributes:
        nodes: (m, 2) in those units.
        centre: (2,) of the nodes, in the image's units.
        radius: RMS distance of the nodes from it.
        weights: (m, r - 3) kernel weights w, times √m.
        affine: (3, r - 3) affine parts, times √m.
        stiffness: (r,) bending energy of each function of unit size, 1 for the softest that bends; 0 for the affine ones.
    """

    nodes: Array
    centre: Array
    radius: float
    weights: Array
    affine: Array
    stiffness: Array

    def at(self, points: Array) -> Array:
        """Values (n, r) of all functions at points (2, n) of the image."""
        x = (points.T - self.centre) / self.radius
        flat = np.column_stack([np.ones(len(x)), x])
        return np.concatenate([flat, thin_plate(x, self.nodes) @ self.weights + flat @ self.affine], axis=1)

    def slopes_at(self, points: Array) -> Array:
        """Derivatives (n, r, 2) of all functions by the place of points (2, n) of the image."""
        x = (points.T - self.centre) / self.radius
        apart = x.T[:, :, None] - self.nodes.T[:, None]  # (2, n, m)
        bent = (apart * (np.log((apart**2).sum(axis=0) + 1e-18) + 1)) @ self.weights + self.affine[1:, None]
        flat = np.broadcast_to(np.eye(3)[1:, None], (2, len(x), 3))
        return np.asarray(np.concatenate([flat, bent], axis=2).transpose(1, 2, 0) / self.radius)


def thin_plate(x: Array, y: Array) -> Array:
    """Kernel (n, m) d² log d of the distances between points x (n, 2) and y (m, 2)."""
    squared = np.maximum((x**2).sum(axis=1)[:, None] - 2 * x @ y.T + (y**2).sum(axis=1), 0.0)
    return np.asarray(0.5 * squared * np.log(squared + 1e-18))


def smooth_field(nodes: Array, functions: int) -> SmoothField:
    """The field of so many functions over nodes (2, m) of an image; fewer where there are fewer nodes."""
    centre = nodes.mean(axis=1)
    radius = float(np.sqrt(((nodes.T - centre) ** 2).sum(axis=1).mean()))
    x = (nodes.T - centre) / radius
    kernel = thin_plate(x, x)
    Q, R = np.linalg.qr(np.column_stack([np.ones(len(x)), x]))
    off = np.eye(len(x)) - Q @ Q.T
    values, U = np.linalg.eigh(off @ kernel @ off)
    leading = np.argsort(-np.abs(values))[: max(0, min(functions, len(x)) - 3)]
    values, U = values[leading], U[:, leading]
    size = np.sqrt(len(x))
    w = U / values
    affine = -np.linalg.solve(R, Q.T @ (kernel @ w))
    stiffness = np.concatenate([np.zeros(3), np.abs(values[:1].sum() / values)])
    return SmoothField(x, centre, radius, w * size, affine * size, stiffness)
