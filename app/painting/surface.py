"""The surface that is painted: a regular net that follows the tracked points, and goes on smoothly to the outline."""

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array, eye_array, kron, vstack
from scipy.sparse.linalg import splu

from app.arrays import Array, Flags, Floats, Indices, Mask
from app.painting.shading import sampled
from reconstruction.basis.mesh import Mesh, neighbour_averages

NODES = 450  # of the net, about
EDGE_PX, EDGE_TRUST = 14.0, 0.03  # points so near to the outline show what is behind the sheet, too
BENDING = 0.02  # weight of the net's bending against the points
TENSION = 0.3  # weight of the differences between nodes' offsets against the points' own
STRETCHING = 0.01  # the same, where the border is drawn to the sheet's edge
NEAREST = 0.05  # of the surface's mean depth: what goes on to behind the camera ends there
USUAL_PX, FAR = 1.0, 4.0  # offset, and its multiple of the frame's median, at which a point is believed a quarter
ROUNDS = 20  # of diffusing the points' offsets from the shape over their neighbours
OUTLIER_PX = 1.5  # a point whose offset differs from its neighbours' by this counts half


@dataclass(frozen=True)
class Net:
    """Nodes (q, 2) px in the first frame, and their triangles (m, 3)."""

    nodes_px: Array
    faces: Indices


class Surface:
    """Where the net is in a frame.

    Args:
        reference_px: (p, 2) the vertices in the first frame.
        mesh: their triangles.
        quad: (4, 2) px in the first frame, a figure around the surface, along its axes; the outline itself where that has
            four corners.
        region: (H, W) 255 where the surface is in the first frame, None: all of the figure.
        sheet: whether the figure is the outline.

    Attributes:
        net: in the first frame.
        shape: rows and columns of its nodes.
    """

    def __init__(self, reference_px: Array, mesh: Mesh, quad: Array, region: Mask | None, *, sheet: bool = False) -> None:
        wide, tall = (float(np.linalg.norm(quad[k] - quad[0])) for k in (1, 3))
        side = float(np.sqrt(max(wide * tall, 1.0) / NODES))
        columns, rows = max(2, round(wide / side)), max(2, round(tall / side))
        to_net = homography(quad, np.array(((0, 0), (columns, 0), (columns, rows), (0, rows)), float))
        grid = np.stack(np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0)), axis=-1).reshape(-1, 2)
        self.net, self._grid = Net(mapped(grid, cast(Array, np.linalg.inv(to_net))), net_faces(columns, rows)), grid
        if region is not None:
            self.net = Net(self.net.nodes_px, faces_in(self.net, region))
        self._to_net, self.shape = to_net, (rows + 1, columns + 1)
        places = mapped(reference_px, to_net)
        trust = np.where(beside(reference_px, quad), EDGE_TRUST, 1.0) if sheet else None
        self._shape = Interpolation(places, (columns, rows), bends(columns + 1, rows + 1), BENDING, trust)
        self._places = places
        self._stretch: Interpolation | None = None
        self._offset = Interpolation(places, (columns, rows), steps(columns + 1, rows + 1), TENSION, trust)
        self._averages = neighbour_averages(mesh, len(reference_px))

    def nodes(self, projection_px: Array, depth: Array, points_px: Array, *, perspective: bool) -> tuple[Array, Array]:
        """The net's nodes (q, 2) px in a frame, and their depths (q,).

        Args:
            projection_px: (p, 2) the vertices as the shape projects them.
            depth: (p,) their depths.
            points_px: (p, 2) where they are, by `corrected`.
            perspective: whether the camera is.
        """
        weight = depth[:, None] if perspective else np.ones((len(depth), 1))
        shape = self._shape(np.column_stack([projection_px * weight, weight, depth]))
        far = np.maximum(shape[:, 2:3], NEAREST * float(weight.mean()))
        return np.asarray(shape[:, :2] / far + self._offset(points_px - projection_px)), shape[:, 3]

    def stretched(self, nodes_px: Array, border: Indices, off: Array) -> Array:
        """The nodes (q, 2) with those at the border (n,) moved by `off` (n, 2), where points hold it between them.

        The first call says which are at the border.
        """
        if self._stretch is None:
            rows, columns = self.shape
            held = self._places[((self._places > 1.5) & (self._places < np.array((columns, rows)) - 2.5)).all(axis=1)]
            places = np.concatenate([held, self._grid[border]])
            self._stretch = Interpolation(places, (columns - 1, rows - 1), steps(columns, rows), STRETCHING)
            self._held = len(held)
        return np.asarray(nodes_px + self._stretch(np.concatenate([np.zeros((self._held, 2)), off])))

    def carried(self, values: Array, uv: Floats) -> Floats:
        """Values (q, 2) of the nodes, at places uv (h, w, 2) px of the first frame."""
        net = cast(Floats, values.reshape(*self.shape, 2).astype(np.float32))
        return sampled(net, cast(Floats, cv2.perspectiveTransform(uv, self._to_net)), cv2.BORDER_REPLICATE)

    def corrected(self, projection_px: Array, observed_px: Array) -> Array:
        """The vertices (p, 2) where they are seen; others are moved off the shape as their neighbours are."""
        visible: Flags = np.isfinite(observed_px[:, 0])
        seen = np.where(visible, (observed_px - projection_px) @ np.array((1, 1j)), 0.0)
        size = np.abs(seen)
        # Points at the sheet's edge show half of what is behind it, and slide along.
        usual = max(USUAL_PX, FAR * float(np.median(size[visible]))) if visible.any() else USUAL_PX
        trust = visible / (1.0 + (size / usual) ** 2) ** 2
        off = trust * seen
        for _ in range(ROUNDS):
            around = self._averages @ off
            off = around + trust / (1.0 + (np.abs(seen - around) / OUTLIER_PX) ** 2) * (seen - around)
        return np.asarray(projection_px + np.column_stack([off.real, off.imag]))


def first_frame_px(places_px: Array, nodes_px: Array, net: Net) -> Array:
    """Where places (n, 2) px of a frame with the net's nodes (q, 2) are in the first frame; off it, as at its border."""
    a, b, c = (nodes_px[net.faces[:, k]] for k in range(3))
    found = []
    for place in places_px:
        along = np.stack([b - a, c - a], axis=-1)
        flat = np.abs(np.linalg.det(along)) < 1e-9
        share = np.linalg.solve(np.where(flat[:, None, None], np.eye(2), along), (place - a)[..., None])[..., 0]
        outside = np.maximum(-share.min(axis=1), share.sum(axis=1) - 1) + 1e9 * flat
        face = int(np.argmin(outside))
        weights = np.array((1 - share[face].sum(), *share[face]))
        found.append(weights @ net.nodes_px[net.faces[face]])
    return np.array(found)


class Interpolation:
    """Values of a net's nodes by values at points between them, under a penalty; a sparse system that is factorised once.

    Args:
        places: (p, 2) the points, counted in cells.
        cells: columns and rows of the net.
        penalty: (n, q) what should be small of the nodes' values.
        weight: of its square against the points'.
        trust: (p,) weights of the points; without it they are 1.
    """

    def __init__(
        self, places: Array, cells: tuple[int, int], penalty: csr_array, weight: float, trust: Array | None = None
    ) -> None:
        columns, rows = cells
        cell = np.clip(np.floor(places), 0, np.array(cells) - 1).astype(np.int64)
        x, y = (places - cell).T
        first = cell[:, 1] * (columns + 1) + cell[:, 0]
        number = first[:, None] + np.array((0, 1, columns + 1, columns + 2))
        share = np.column_stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y])
        at = (np.repeat(np.arange(len(places)), 4), number.ravel())
        bilinear = csr_array((share.ravel(), at), shape=(len(places), (columns + 1) * (rows + 1)))
        self._to_nodes = csr_array(bilinear.T if trust is None else bilinear.T @ diags_array(trust))
        normal = self._to_nodes @ bilinear + weight * (penalty.T @ penalty)
        self._factors = splu(csc_array(normal + 1e-9 * eye_array(normal.shape[0])))

    def __call__(self, values: Array) -> Array:
        """The nodes' values (q, k) by the points' (p, k)."""
        return cast(Array, self._factors.solve(self._to_nodes @ values))


def bends(columns: int, rows: int) -> csr_array:
    """Second differences (n, q) of the nodes of a net: 0 for what is flat."""
    across, down = differences(columns), differences(rows)
    twice = (
        kron(eye_array(rows), differences(columns - 1) @ across),
        kron(differences(rows - 1) @ down, eye_array(columns)),
    )
    return cast(csr_array, csr_array(vstack([*twice, np.sqrt(2) * kron(down, across)])))


def steps(columns: int, rows: int) -> csr_array:
    """First differences (n, q) of the nodes of a net."""
    both = (kron(eye_array(rows), differences(columns)), kron(differences(rows), eye_array(columns)))
    return cast(csr_array, csr_array(vstack(both)))


def differences(count: int) -> csr_array:
    """From numbers in a row to the steps between them (count − 1, count)."""
    return cast(csr_array, csr_array(diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count - 1, count))))


def beside(points: Array, quad: Array) -> Flags:
    """Which points (n, 2) are near the outline (4, 2)."""
    curve = quad.astype(np.float32)
    far = [cv2.pointPolygonTest(curve, (float(x), float(y)), measureDist=True) for x, y in points]
    return np.asarray(far) < EDGE_PX


def net_faces(columns: int, rows: int) -> Indices:
    """Triangles (m, 3) of a net with so many cells."""
    x, y = np.meshgrid(np.arange(columns), np.arange(rows))
    a = (y * (columns + 1) + x).ravel()
    b, c, d = a + 1, a + columns + 1, a + columns + 2
    return np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])]).astype(np.int64)


def faces_in(net: Net, region: Mask) -> Indices:
    """The net's triangles that reach into a region (H, W)."""
    wide = cv2.dilate(region, np.ones((3, 3), np.uint8))
    height, width = region.shape
    inside = np.zeros(len(net.faces), bool)
    weights = np.array([(i, j, 4 - i - j) for i in range(5) for j in range(5 - i)]) / 4
    for weight in weights:
        x, y = np.rint(np.einsum("k,fkc->fc", weight, net.nodes_px[net.faces])).astype(int).T
        within = (x >= 0) & (y >= 0) & (x < width) & (y < height)
        inside |= within & (wide[np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)] > 0)
    return net.faces[inside]


def homography(source: Array, target: Array) -> Array:
    """The (3, 3) map of four points (4, 2) onto four others."""
    return cast(Array, cv2.getPerspectiveTransform(source.astype(np.float32), target.astype(np.float32)))


def mapped(points: Array, by: Array) -> Array:
    """Points (n, 2) under a homography (3, 3)."""
    return cast(Array, cv2.perspectiveTransform(points[None].astype(np.float64), by)[0])
