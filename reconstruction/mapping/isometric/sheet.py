"""What is known of a sheet that bends and does not stretch: its lengths, and its shapes in keyframes and elsewhere."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.bundle import FUNCTIONS, GIVE, Lengths, data_normal, stepped
from reconstruction.mapping.isometric.images.smooth_field import ENOUGH, GROSS, SmoothField
from reconstruction.mapping.isometric.images.warps import Warps
from reconstruction.mapping.isometric.lengths import Edges, Solver, mean_log_lengths
from reconstruction.mapping.isometric.nodes import USUAL_STRAIN, Nodes, edges_between, on_edges, rays_of
from reconstruction.mapping.isometric.shape_prior import ShapePrior, shape_prior
from reconstruction.window.robust import geman_mcclure, lengths

# Lengths of a sheet change by less between its bundled shapes, which hold no noise. By more, they really do (a balloon, a
# crease), and then no rest shape is right, or bends are finer than its functions.
USUAL_STRETCH = 0.0042
FARTHEST = 1.5  # times as deep as before, or less deep: a step that goes further has lost its way, and is not taken


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
        usual_change: median of that; once keyframes are bundled, of their bundled shapes.
        solver: with which the depths were found.
        shape_functions: R, of the functions of the images, that bundled shapes are made of.
        camera: the camera.
        give: what lengths of bundled shapes are taken to change by, noise apart.
        by_focal: how far shapes may be off since the focal length was looked for, RMS over their size; 0 if it is given.
    """

    warps: Warps
    nodes: Nodes
    field: SmoothField
    values: Array
    coefficients: Array
    log_lengths: Array
    edge_weights: Array
    strain: Array
    usual_change: float
    solver: Solver
    shape_functions: int
    camera: Camera
    give: float = GIVE
    by_focal: float = 0.0

    @property
    def note(self) -> str:
        """All that in words."""
        creases = (f" with {n} crease{'s' if n > 1 else ''}") if (n := len(self.field.creases)) else ""
        return f"sheet{creases} from {len(self.coefficients)} keyframes, lengths change by {self.strain_rms:.1%}"

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

    @property
    def change(self) -> float:
        """Change of length in units of depth: a sheet much too deep has long lengths, which change by a small share."""
        return self.strain_rms * float(np.exp(self.log_lengths.mean()))

    @cached_property
    def far(self) -> bool:
        """Whether perspective tells nothing: no use in looking further."""
        return self.nodes.far(self.camera)

    @cached_property
    def stretch(self) -> float:
        """Change of length between its shapes, rms over frames and all edges, also those that were found to break.

        Once it is bundled, shapes hold hardly any noise: 0.002 to 0.005 where all is well, whatever the noise.
        """
        logs = self.lengths.now(self.shapes()[:, :, self.warps.few] @ self.projector)[0]
        return float(np.sqrt(((logs - np.median(logs, axis=0)) ** 2).mean()))

    def shapes(self) -> Array:
        """(F, 3, p) in camera axes, of all points, also those not visible; NaN for points that no keyframe shows."""
        return self.along_rays(self.coefficients, self.warps.images())

    def both(self, W: Array) -> tuple[Array, Array]:
        """Its `shapes`, smooth, and the same with the points where the keyframes W (F, 2, p) px saw them."""
        return self.shapes(), self.along_rays(self.coefficients, W)

    def along_rays(self, c: Array, images: Array) -> Array:
        """Shapes (F, 3, p) by coefficients (F, r) of log depths, along the rays of images (F or 1, 2, p) px."""
        return np.exp(c @ self.values.T)[:, None] * rays_of(images, self.camera)

    @cached_property
    def at_middles(self) -> Array:
        """(n, R) the functions that images are made of at the middles of the edges."""
        return self.warps.field.at(self.nodes.halfway)

    @cached_property
    def edges(self) -> Edges:
        """Its edges in its keyframes, weighted by whether they keep their length, too."""
        return self.edges_in(self.nodes)

    def edges_in(self, nodes: Nodes) -> Edges:
        """The same in some frames, by its nodes there."""
        return edges_between(nodes, self.on_edges, self.camera).weighted(self.edge_weights)

    @cached_property
    def on_edges(self) -> Array:
        """(3, n, r) the functions that log depths are made of at first end, middle and second end of each edge."""
        return on_edges(self.nodes, self.field)

    @property
    def functions(self) -> Array:
        """(p, R) those that shapes are made of."""
        return self.warps.values[:, : self.shape_functions]

    @cached_property
    def lengths(self) -> Lengths:
        """Its edges."""
        first, second = self.functions[self.nodes.points[self.nodes.ends]].swapaxes(0, 1)
        middle = self.at_middles[:, : self.shape_functions]
        return Lengths(
            np.stack([middle - first, second - middle]),
            self.log_lengths,
            self.edge_weights,
            self.warps.field.stiffness[: self.shape_functions],
            self.give,
        )

    @cached_property
    def projector(self) -> Array:
        """(m, R) what takes the few points of shapes to their coefficients."""
        return np.asarray(np.linalg.pinv(self.functions[self.warps.few]).T)

    def prior_of(self, shapes: Array, *, of_others: bool) -> ShapePrior:
        """What shapes (F, 3, p) in its keyframes say of others, or of each other."""
        few = self.warps.few
        C = shapes[:, :, few] @ self.projector
        return shape_prior(C, self.functions[few], self.lengths.stiffness, of_others=of_others)

    @cached_property
    def prior(self) -> ShapePrior:
        """What its shapes in its keyframes say of other frames'."""
        return self.prior_of(self.shapes(), of_others=False)

    def bundled(self, shapes: Array, W: Array, weights: Array, prior: ShapePrior, *, free: bool = False) -> Array:
        """Coefficients (F, 3, R) of shapes (F, 3, p) adjusted once to points W (F, 2, p) px with weights (F, p) px⁻².

        And to its lengths, or to each other's, if those are free.
        """
        few, B = self.warps.few, self.functions
        C = shapes[:, :, few] @ self.projector
        rows = few if (weights[:, few] > 0).mean() > ENOUGH else np.arange(len(B))
        rays = rays_of(W[:, :, rows], self.camera)[:, :2]
        normal = data_normal(rays, weights[:, rows] * self.camera.focal_px**2, C, B[rows])
        step = stepped(C, normal, self.lengths, prior, free=free)
        depth = (step[:, 2] @ B[few].T) / shapes[:, 2, few]
        good = (np.abs(np.log(np.maximum(depth, 1e-9))) < np.log(FARTHEST)).all(axis=1)  # of NaN, too, it is not
        return np.asarray(np.where(good[:, None, None], step, C))

    def residuals(self, shapes: Array, W: Array) -> Array:
        """How far (F, 2, p) px shapes (F, 3, p) are seen off points W (F or 1, 2, p) px; very far behind the camera."""
        depth = np.maximum(shapes[:, 2:], 1e-9)
        return self.camera.project(np.concatenate([shapes[:, :2], depth], axis=1)) - W

    def weighed(self, shapes: Array, W: Array, seen: Mask) -> Array:
        """Weights (F, p) px⁻² of points W (F, 2, p) px, seen (F, p), by how far shapes (F, 3, p) are off them."""
        noise = self.warps.noise_px[:, None]
        off = lengths(self.residuals(shapes, W)) / noise
        fit = geman_mcclure(off / GROSS) / noise**2
        return np.where(seen & self.warps.placed & (off < GROSS), fit, 0.0)

    def length_change(self, C: Array) -> Array:
        """Change of length (F,) in shapes of coefficients C (F, 3, R), weighted rms: in bundled ones hardly by noise."""
        off = self.lengths.now(C)[0] - self.log_lengths
        return np.asarray(np.sqrt(off**2 @ self.edge_weights / max(float(self.edge_weights.sum()), 1e-12)))

    def cost(self, C: Array, W: Array, weights: Array) -> Array:
        """How badly shapes C (F, 3, R) fit (F,), all points, of which bundling takes few, W (2, p) px with weights (p,)."""
        off = self.residuals(C @ self.functions.T, W)
        total = float(self.edge_weights.sum())
        return np.asarray(
            np.where(weights > 0, weights * (off**2).sum(axis=1), 0.0).sum(axis=1)
            + total * (self.length_change(C) / self.give) ** 2
            + self.prior.cost(C)
        )

    def moved(self, places: Array) -> "IsometricSheet":
        """The same with points at other places (2, p) of the reference image."""
        warps, values = self.warps.moved(places), np.full_like(self.values, np.nan)
        values[warps.placed] = self.field.at(places[:, warps.placed])
        nodes = replace(self.nodes, reference=places[:, self.nodes.points])  # its middles come with the shapes
        return replace(self, warps=warps, values=values, nodes=nodes)

    def with_shapes(self, shapes: Array) -> "IsometricSheet":
        """The same with other shapes (F, 3, p) in its keyframes.

        Raises:
            ReconstructionError: a part of them is behind the camera.
        """
        few = self.warps.few
        if (shapes[:, 2, few] <= 0).any():
            raise ReconstructionError("the sheet comes out behind the camera: what the keyframes show is none")
        image = self.camera.project(shapes[:, :, few])
        to_images, to_depths = (np.linalg.pinv(B[few]) for B in (self.warps.values, self.values))
        warps = replace(self.warps, coefficients=to_images @ image.transpose(0, 2, 1))
        nodes = replace(self.nodes, images=warps.images(self.nodes.points), middles=warps.images_at(self.nodes.halfway))
        return replace(self, warps=warps, nodes=nodes, coefficients=np.log(shapes[:, 2, few]) @ to_depths.T)


def described(
    warps: Warps,
    nodes: Nodes,
    field: SmoothField,
    values: Array,
    c: Array,
    factor: Array,
    camera: Camera,
    solver: Solver,
    shape_functions: int = FUNCTIONS,
) -> IsometricSheet:
    """The sheet of coefficients (F, r), with its lengths and how well they are kept; weights of edges (n,) by a factor."""
    edges = edges_between(nodes, on_edges(nodes, field), camera).weighted(factor)
    g = edges.log_lengths(c)
    logs = mean_log_lengths(edges, g)
    strain = edges.rms(g - logs)
    usual = float(np.median(strain))
    return IsometricSheet(warps, nodes, field, values, c, logs, factor, strain, usual, solver, shape_functions, camera)
