"""A sheet's shape in one more frame, its lengths known.

Depths along the rays of a smooth image keep lengths about as well in a wrong minimum as in the right one, since an image
made smooth by itself holds noise. Shapes adjusted to points and lengths at once tell them apart. A frame's is the cheaper
of those from the keyframe most alike and from the frame before; where its lengths change more than they usually do, other
starts are tried. Without perspective several shapes fit an image about as well, since what slopes either way looks alike:
the one goes on that there was.
"""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.mapping.isometric.images.warps import quick_fit
from reconstruction.mapping.isometric.lengths import finish_depths
from reconstruction.mapping.isometric.nodes import Nodes, nearest
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.isometric.starts import convex_finish, distinct

RENEWED = 0.3  # weight of the newest frame in the usual change of lengths
DOUBTED = 1.3  # times the usual change of length: the frame may be in another minimum
STARTS, STEPS = 6, 3  # keyframes that a frame in doubt starts from, and steps of depths: they are only the start
ALIKE = 0.05  # of the depth's relief: shapes that differ by less are one
MOST = 4  # different ones are bundled
STEPS_USUALLY, STEPS_IN_DOUBT = 2, 8  # of bundling: after a few, a wrong shape may still cost less than the right one
STEPS_ON = 4  # of bundling, from the frame before
GOES_ON = 1.5  # times what the cheapest shape costs, that may cost which goes on, without perspective
SETTLED = 0.999  # of its cost before: a shape that costs no less after a step is not bundled any more


@dataclass(frozen=True)
class Foreseen:
    """A sheet's shape in a frame, by its lengths.

    Attributes:
        shape: (3, p) in camera axes; NaN for points that no keyframe shows.
        usual: change of lengths up to this frame, later ones counting more.
    """

    shape: Array
    usual: float


def shape_in(sheet: IsometricSheet, W: Array, visible: Mask, last: Foreseen | None = None) -> Foreseen:
    """The shape in one more frame W (2, p) px, visible (p,), its lengths known.

    Args:
        sheet: that, by keyframes.
        W: as above; finite.
        visible: as above.
        last: the shape in the frame before: a start beside the depths of the keyframe that looks most alike.
    """
    points = sheet.nodes.points
    coefficients, variance, weights = quick_fit(sheet.warps, W, visible, points)
    image, middles = ((B @ coefficients).T for B in (sheet.warps.values, sheet.at_middles))
    usual = sheet.usual_change if last is None else max(sheet.usual_change, last.usual)
    nodes = replace(sheet.nodes, images=image[None, :, points], variance=variance[None], middles=middles[None])
    most_alike = nearest(nodes.images, sheet.nodes.images)[0, :1]
    shapes = sheet.along_rays(sheet.coefficients[most_alike], image[None])
    if last is not None:
        shapes = np.concatenate([shapes, last.shape[None]])
    C = cheapest(sheet, shapes, W, weights)
    if sheet.length_change(C)[0] > DOUBTED * usual:
        C = best_of_starts(sheet, nodes, image, W, weights, C @ sheet.functions.T)
    if last is not None and sheet.far:
        on = cheapest(sheet, last.shape[None], W, weights, STEPS_ON)
        C = on if sheet.cost(on, W, weights)[0] < GOES_ON * sheet.cost(C, W, weights)[0] else C
    return Foreseen(
        np.where(sheet.warps.placed, C[0] @ sheet.functions.T, np.nan),
        (1 - RENEWED) * usual + RENEWED * float(sheet.length_change(C)[0]),
    )


def best_of_starts(sheet: IsometricSheet, nodes: Nodes, image: Array, W: Array, weights: Array, shapes: Array) -> Array:
    """Coefficients (1, 3, R) of what costs least in a frame: of shapes, what look-alikes lead to, and the deepest shape.

    Args:
        sheet: that, by keyframes.
        nodes: its nodes in the frame's image (F = 1).
        image: (2, p) px, the frame's points made smooth.
        W: (2, p) px, as they were seen; finite.
        weights: (p,) px⁻².
        shapes: (G, 3, p) that it may have.
    """
    stiffness, edges = sheet.field.stiffness, sheet.edges_in(nodes)
    alike = nearest(nodes.images, sheet.nodes.images)[0, :STARTS]
    values = sheet.values[nodes.points]
    deepest = convex_finish(nodes, edges, sheet.nodes, sheet.coefficients, values, stiffness, sheet.camera)
    starts = np.concatenate([sheet.coefficients[alike], deepest])
    many = edges.frames(np.zeros(len(starts), np.int64))
    c, costs = finish_depths(many, sheet.log_lengths, starts, stiffness, sheet.solver.bend, STEPS)
    ends = np.concatenate([shapes, sheet.along_rays(c[costs.argsort()], image[None])])
    depths = np.log(np.maximum(ends[:, 2, nodes.points], 1e-9))
    return cheapest(sheet, ends[distinct(depths, ALIKE)[:MOST]], W, weights, STEPS_USUALLY if sheet.far else STEPS_IN_DOUBT)


def cheapest(sheet: IsometricSheet, shapes: Array, W: Array, weights: Array, steps: int = STEPS_USUALLY) -> Array:
    """Coefficients (1, 3, R) of that of shapes (G, 3, p) in one frame which costs least, bundled in up to so many steps."""
    least, costs = np.inf, np.full(len(shapes), np.inf)
    for _ in range(steps):
        seen = [np.broadcast_to(one, (len(shapes), *one.shape)) for one in (W, weights)]
        C = sheet.bundled(shapes, seen[0], seen[1], sheet.prior)
        before, costs = costs, sheet.cost(C, W, weights)
        if least == np.inf or costs.min() < least:
            best, least = C[[costs.argmin()]], costs.min()
        going = costs < SETTLED * before
        if not going.any():
            break
        shapes, costs = C[going] @ sheet.functions.T, costs[going]
    return np.asarray(best)
