"""What is known of a sheet that bends and does not stretch: its lengths, and its shapes in keyframes and elsewhere."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.bundle import FUNCTIONS, Lengths, data_normal, stepped
from reconstruction.mapping.isometric.convex import convex_finish
from reconstruction.mapping.isometric.lengths import Edges, best_start
from reconstruction.mapping.isometric.nodes import USUAL_STRAIN, Nodes, edges_between, nearest, on_edges, rays_of
from reconstruction.mapping.isometric.robust_fit import ENOUGH
from reconstruction.mapping.isometric.smooth_field import SmoothField
from reconstruction.mapping.isometric.warps import Warps, quick_fit

STEPS = 2  # of depths: they are only the start
HELD = 0.03  # of the image's RMS radius: how far a point that is not seen may be off where its neighbours put it
RENEWED = 0.3  # weight of the newest frame in the usual change of lengths
FARTHEST = 1.5  # times as deep as before, or less deep: a step that goes further has lost its way, and is not taken
STUCK = 1.3  # times the usual frame's change of length: a frame that may be in another minimum


@dataclass(frozen=True)
class Foreseen:
    """A sheet's shape in a frame, by its lengths.

    Attributes:
        shape: (3, p) in camera axes.
        known: (p,) which of its points are known: seen, or held by those around them.
        usual: change of lengths up to this frame, later ones counting more.
    """

    shape: Array
    known: Mask
    usual: float


@dataclass(frozen=True)
class IsometricSheet:
    """Shapes of a sheet in F frames, and its lengths, up to one scale: mean log depth 0.

    Attributes:
        warps: the frames' images as smooth functions of the reference image.
        nodes: the points whose distances were compared.
        field: smooth functions over the reference image that log depths are made of.
        values: (p, r) of those at all points; NaN for points that no keyframe shows.
        coefficients: (F, r) of the log depths.
        log_lengths: (n,) of the nodes' edges: the metric rest shape.
        edge_weights: (n,) 1 for edges that keep their length, near 0 for those that do not.
        strain: (F,) change of length in each frame, weighted rms.
        change: usual change of length of any edge, broken or not.
        bend: weight λ of bending that the depths were found with.
        camera: the camera.
    """

    warps: Warps
    nodes: Nodes
    field: SmoothField
    values: Array
    coefficients: Array
    log_lengths: Array
    edge_weights: Array
    strain: Array
    change: float
    bend: float
    camera: Camera

    @property
    def strain_rms(self) -> float:
        """Change of length, rms over frames and edges: 0.003 to 0.01 where all is well."""
        return float(np.sqrt((self.strain**2).mean()))

    @property
    def strain_beyond_noise(self) -> float:
        """The same without what noise explains."""
        squared = self.nodes.noise_squared()
        weights = self.edge_weights / (1 + squared / USUAL_STRAIN**2)
        by_noise = float((weights * squared).sum() / max(weights.sum(), 1e-12))
        return float(np.sqrt(max(self.strain_rms**2 - by_noise, 0.0)))

    @cached_property
    def stretch(self) -> float:
        """Change of length between its shapes, rms over frames and all edges, also those that were found to break.

        Once it is bundled, shapes hold hardly any noise: 0.002 to 0.005 where all is well, whatever the noise.
        """
        logs = self.lengths.now(self.shapes()[:, :, self.warps.few] @ self.projector)[0]
        return float(np.sqrt(((logs - np.median(logs, axis=0)) ** 2).mean()))

    @property
    def log_depths(self) -> Array:
        """(F, p) of all points; NaN for points that no keyframe shows."""
        return np.asarray(self.coefficients @ self.values.T)

    def shapes(self) -> Array:
        """(F, 3, p) in camera axes, of all points, also those not visible; NaN for points that no keyframe shows."""
        return np.exp(self.log_depths)[:, None] * rays_of(self.warps.images(), self.camera)

    def through(self, W: Array) -> Array:
        """(F, 3, p) in camera axes as `shapes`, with the points where the keyframes W (F, 2, p) px saw them."""
        return np.exp(self.log_depths)[:, None] * rays_of(W, self.camera)

    def shape_in(self, W: Array, visible: Mask, usual: float = 0.0) -> Foreseen:
        """The shape in one more frame W (2, p) px, visible (p,), its lengths known.

        It starts from the two keyframes that look most alike, and where both do badly from the deepest shape.

        Args:
            W: as above.
            visible: as above.
            usual: change of lengths in the frames before, which is not bad, if that in keyframes is less.
        """
        points = self.nodes.points
        coefficients, variance, weights = quick_fit(self.warps, W, visible, points)
        image, middles = ((B @ coefficients).T for B in (self.warps.values, self.halfway))
        c, strain = self._depths(
            replace(self.nodes, images=image[None, :, points], variance=variance[None], middles=middles[None]), usual
        )
        held = np.sqrt(variance) < HELD * np.sqrt(np.var(image[:, points], axis=1).sum())
        known = visible | held[self.nodes.nearest(self.warps.reference)]
        start = np.exp(c @ self.values.T) * rays_of(image[None], self.camera)[0]
        C = self.bundled(start[None], W[None], weights[None])[0]
        return Foreseen(
            np.where(self.warps.placed, C @ self.functions.T, np.nan),
            known,
            (1 - RENEWED) * usual + RENEWED * float(strain[0]),
        )

    @cached_property
    def halfway(self) -> Array:
        """(n, R) the functions that images are made of at the middles of the edges."""
        return self.warps.field.at(self.nodes.halfway)

    @cached_property
    def edges(self) -> Edges:
        """Its edges in its keyframes, weighted by whether they keep their length, too."""
        return edges_between(self.nodes, on_edges(self.nodes, self.field), self.camera).weighted(self.edge_weights)

    @property
    def functions(self) -> Array:
        """(p, R) those that shapes are made of."""
        return self.warps.values[:, :FUNCTIONS]

    @cached_property
    def lengths(self) -> Lengths:
        """Its edges."""
        first, second = self.functions[self.nodes.points[self.nodes.ends]].swapaxes(0, 1)
        middle = self.halfway[:, :FUNCTIONS]
        return Lengths(
            np.stack([middle - first, second - middle]),
            self.log_lengths,
            self.edge_weights,
            self.warps.field.stiffness[:FUNCTIONS],
        )

    @cached_property
    def projector(self) -> Array:
        """(m, R) what takes the few points of shapes to their coefficients."""
        return np.asarray(np.linalg.pinv(self.functions[self.warps.few]).T)

    def bundled(self, shapes: Array, W: Array, weights: Array) -> Array:
        """Coefficients (F, 3, R) of shapes (F, 3, p) adjusted once to points W (F, 2, p) px with weights (F, p) px⁻²."""
        few, B = self.warps.few, self.functions
        C = shapes[:, :, few] @ self.projector
        rows = few if (weights[:, few] > 0).mean() > ENOUGH else np.arange(len(B))
        rays = rays_of(W[:, :, rows], self.camera)[:, :2]
        normal = data_normal(rays, weights[:, rows] * self.camera.focal_px**2, C, B[rows])
        step = stepped(C, normal, self.lengths)
        depth = (step[:, 2] @ B[few].T) / shapes[:, 2, few]
        good = (np.abs(np.log(np.maximum(depth, 1e-9))) < np.log(FARTHEST)).all(axis=1)  # of NaN, too, it is not
        return np.asarray(np.where(good[:, None, None], step, C))

    def moved(self, places: Array) -> "IsometricSheet":
        """The same with points at other places (2, p) of the reference image."""
        warps, values = self.warps.moved(places), np.full_like(self.values, np.nan)
        values[warps.placed] = self.field.at(places[:, warps.placed])
        nodes = replace(self.nodes, reference=places[:, self.nodes.points])
        nodes = replace(nodes, middles=warps.images_at(nodes.halfway))
        return replace(self, warps=warps, values=values, nodes=nodes)

    def with_shapes(self, shapes: Array) -> "IsometricSheet":
        """The same with other shapes (F, 3, p) in its keyframes.

        Raises:
            ReconstructionError: a part of them is behind the camera.
        """
        few = self.warps.few
        if (shapes[:, 2, few] <= 0).any():
            raise ReconstructionError("the sheet comes out behind the camera: what the keyframes show is none")
        image = shapes[:, :2, few] / shapes[:, 2:, few] * self.camera.focal_px + self.camera.center_px[:, None]
        to_images, to_depths = (np.linalg.pinv(B[few]) for B in (self.warps.values, self.values))
        warps = replace(self.warps, coefficients=to_images @ image.transpose(0, 2, 1))
        nodes = replace(self.nodes, images=warps.images(self.nodes.points), middles=warps.images_at(self.nodes.halfway))
        return replace(self, warps=warps, nodes=nodes, coefficients=np.log(shapes[:, 2, few]) @ to_depths.T)

    def _depths(self, nodes: Nodes, usual: float) -> tuple[Array, Array]:
        """Coefficients (F, r) of log depths with which nodes keep their lengths in their images, and how well (F,)."""
        edges = edges_between(nodes, self.edges.B, self.camera).weighted(self.edge_weights)
        alike = nearest(nodes.images, self.nodes.images)[:, :2]
        starts = list(self.coefficients[alike].swapaxes(0, 1))
        c = best_start(edges, self.log_lengths, starts, self.field.stiffness, self.bend, STEPS)
        strain = edges.rms(edges.log_lengths(c) - self.log_lengths)
        stuck = np.flatnonzero(strain > STUCK * max(float(np.median(self.strain)), usual))
        if len(stuck):
            some, held, B = nodes.in_frames(stuck), edges.frames(stuck), self.values[nodes.points]
            deepest = convex_finish(some, held, self.nodes, self.coefficients, B, self.field.stiffness, self.camera)
            c[stuck] = best_start(held, self.log_lengths, [c[stuck], deepest], self.field.stiffness, self.bend, STEPS)
            strain[stuck] = held.rms(held.log_lengths(c[stuck]) - self.log_lengths)
        return c, strain
