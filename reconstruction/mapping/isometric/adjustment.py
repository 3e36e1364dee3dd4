"""A sheet that bends and does not stretch, from its keyframes alone: isometric adjustment along the rays.

No rest shape is needed: of all smooth depths along the rays, those under which every line between neighbours is as long in
all keyframes. It needs a perspective camera; `focal` looks for its focal length.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.bundle import FINE_FUNCTIONS as FINE_SHAPES
from reconstruction.mapping.isometric.bundle import GIVE, MOST_GIVE, places_moved
from reconstruction.mapping.isometric.flat_parts import folded
from reconstruction.mapping.isometric.images.creases import creases_in
from reconstruction.mapping.isometric.images.smooth_field import smooth_field
from reconstruction.mapping.isometric.images.warps import Warps, creased, finer, smooth_warps
from reconstruction.mapping.isometric.lengths import Edges, adjust_depths, best_start, finish_depths, robust_lengths
from reconstruction.mapping.isometric.nodes import edges_between, nodes_of, on_edges, rays_of
from reconstruction.mapping.isometric.sheet import IsometricSheet, described
from reconstruction.mapping.isometric.starts import FROM_PLANES, SOLVER, again, coefficients_of, first_depths, once_more

FUNCTIONS, FINE_FUNCTIONS = 40, 60
USUAL_ROUNDS, MOST_ROUNDS = 12, 60  # of shapes with lengths, then places; more than usual where they still bring much:
FALLING = 0.99  # lengths change by less than so many times what they changed by a round before
FEW_ROUNDS = 2  # bring most of that in a tenth of a second
SETTLED = 2e-4  # of the shapes' size: a round that moves them less is the last
ROUNDS = 6  # at most, of starting frames again that do not fit
LITTLE_GAIN = 0.1  # of the change: a round that brought less is the last
CREASED = 0.002  # change of lengths, noise apart, from which on there may be creases;
KEPT, LESS = 0.004, 0.8  # that at which they are believed, and times the change without them
MOST_CHANGE = 0.06  # of lengths, rms, noise apart: no cloth seems to, with folds cut off; less is weighed against a solid
MOST_AT_ALL = 0.08  # with noise: what is that far off smooth images is not noise
MOST_PARALLAX = 0.01  # over the image's RMS radius: true sheets up to 0.5 %, by noise; what is seen through 1.5 % and more


def sheet(W: Array, visible: Mask, camera: Camera) -> IsometricSheet:
    """The sheet that points W (F, 2, p) px with visibility (F, p) lie on, keyframes most different first.

    Points of something else show by distances that change, and count for little.

    Args:
        W: anything where not visible.
        visible: (F, p).
        camera: its focal length is taken as it is.

    Raises:
        ReconstructionError: the camera is orthographic, there are fewer than 3 frames or 20 points, images are not smooth,
            or lengths change.
    """
    smooth = smooth_sheet(W, visible, camera)
    if smooth.strain_beyond_noise <= CREASED or smooth.far:
        return smooth
    if other := mirrored(smooth):
        return other
    creases = creases_in(smooth.warps, W)
    folds = [folded_sheet(creased(smooth.warps, W, visible, some), camera) for some in creases]
    best = min((found for found in folds if found), key=lambda found: found.change, default=smooth)
    return best if best.change < LESS * smooth.change else smooth


def smooth_sheet(W: Array, visible: Mask, camera: Camera) -> IsometricSheet:
    """The same without creases, bent to the side where it comes out at once; arguments and errors as for `sheet`."""
    if not camera.perspective:
        raise ReconstructionError("a sheet's depths along its rays need a perspective camera")
    warps = smooth_warps(W, visible)
    if len(W) < 3 or warps.placed.sum() < 20:
        raise ReconstructionError("a sheet of unknown shape needs 3 keyframes and 20 points")
    if (parallax := warps.parallax_over_size(W, visible)) > MOST_PARALLAX:
        raise ReconstructionError(f"no smooth surface: points are {parallax:.1%} of its size off it, together")
    return on_smooth_images(warps, camera)


def mirrored(found: IsometricSheet) -> IsometricSheet | None:
    """The sheet begun at its mirror image, if that keeps its lengths: what bends to one side alone may end on the other."""
    seen = edges_between(found.nodes, found.on_edges, found.camera)
    logs = robust_lengths(seen, seen.log_lengths(-found.coefficients))[0]
    c = best_start(seen, logs, [-found.coefficients], found.field.stiffness, found.solver.bend)
    with suppress(ReconstructionError):
        other = kept_long(replace(found, coefficients=c), seen)
        return other if other.strain_beyond_noise < KEPT and other.change < LESS * found.change else None
    return None


def folded_sheet(warps: Warps, camera: Camera) -> IsometricSheet | None:
    """The sheet with creases that is seen in images, if it keeps its lengths."""
    with suppress(ReconstructionError):
        found = on_smooth_images(warps, camera)
        return found if found.strain_beyond_noise < KEPT else None
    return None


def on_smooth_images(warps: Warps, camera: Camera) -> IsometricSheet:
    """The sheet that is seen in images that are smooth but for its creases.

    Raises:
        ReconstructionError: no depths keep the lengths.
    """
    nodes = nodes_of(warps)
    field = smooth_field(nodes.reference, FUNCTIONS, warps.field.creases)
    values = warps.values_of(field)
    B = values[nodes.points]
    seen = edges_between(nodes, on_edges(nodes, field), camera)
    if len(field.creases):
        c, solver = coefficients_of(folded(warps, camera)[:, nodes.points], B, field.stiffness), FROM_PLANES
    else:
        c, solver = first_depths(nodes, seen, B, field.stiffness, camera), SOLVER
    return kept_long(described(warps, nodes, field, values, c, np.ones(len(nodes.ends)), camera, solver), seen)


def kept_long(found: IsometricSheet, seen: Edges) -> IsometricSheet:
    """A sheet adjusted from its depths on, stuck frames begun anew, while its edges, as they are seen, keep lengths better.

    Raises:
        ReconstructionError: no depths keep the lengths.
    """
    B, stiffness, solver, camera = found.values[found.nodes.points], found.field.stiffness, found.solver, found.camera
    c, factor, change = found.coefficients, np.ones(len(found.nodes.ends)), np.inf
    for _ in range(ROUNDS):
        c, factor = again(found.nodes, seen, seen.weighted(factor), c, B, stiffness, camera, solver)
        found = described(found.warps, found.nodes, found.field, found.values, c, factor, camera, solver)
        before, change = change, found.strain_rms
        if change > (1 - LITTLE_GAIN) * before:
            break
    if found.strain_beyond_noise > MOST_CHANGE or change > MOST_AT_ALL:
        raise ReconstructionError(f"no sheet of one metric: lengths change by {change:.1%}")
    return found


def by_part(found: IsometricSheet, part: Indices) -> IsometricSheet:
    """The sheet by some of its frames alone: depths and lengths adjusted anew from those there are."""
    nodes = found.nodes.in_frames(part)
    edges = found.edges_in(nodes)
    c = adjust_depths(edges, found.coefficients[part], found.field.stiffness, found.solver)
    warps = found.warps.in_frames(part)
    functions, factor = found.shape_functions, found.edge_weights
    return described(warps, nodes, found.field, found.values, c, factor, found.camera, found.solver, functions)


def in_halves(
    found: IsometricSheet, W: Array, halves: Sequence[Indices]
) -> tuple[list[tuple[Array, Array, Array]], float, int]:
    """Shapes of the sheet for both halves of its keyframes W (F, 2, p) px, as model selection asks for them."""
    made = [by_part(found, half) for half in halves]
    shapes = []
    for one, other, half in zip(made, reversed(made), halves, strict=True):
        told = finish_depths(one.edges, other.log_lengths, one.coefficients, one.field.stiffness, one.solver.bend)[0]
        shapes.append((*one.both(W[half]), one.along_rays(told, W[half])))
    return shapes, found.strain_beyond_noise, len(found.field.creases)


def refined(found: IsometricSheet, W: Array, visible: Mask) -> IsometricSheet:
    """The sheet of finer functions, and with more edges, started from its shapes: for bends that the usual ones cut off.

    Args:
        found: as above.
        W: (F, 2, p) px, its keyframes; anything where not visible.
        visible: (F, p).
    """
    warps = finer(found.warps, W, visible)
    nodes = nodes_of(warps, fine=True)
    field = smooth_field(nodes.reference, FINE_FUNCTIONS, warps.field.creases)
    values = warps.values_of(field)
    B, seen = values[nodes.points], edges_between(nodes, on_edges(nodes, field), found.camera)
    c = found.coefficients @ found.values[nodes.points].T @ np.linalg.pinv(B).T
    c, factor = once_more(seen, seen, c, field.stiffness, found.solver)
    c, factor = again(nodes, seen, seen.weighted(factor), c, B, field.stiffness, found.camera, found.solver)
    finer_one = described(warps, nodes, field, values, c, factor, found.camera, found.solver, FINE_SHAPES)
    return replace(finer_one, by_focal=found.by_focal, give=found.give)


def with_focal(found: IsometricSheet, focal_px: float) -> IsometricSheet:
    """The same keyframes under another focal length, adjusted from the shapes there are, edges weighted as they are."""
    return by_part(replace(found, camera=replace(found.camera, focal_px=focal_px)), np.arange(len(found.coefficients)))


def bundled(found: IsometricSheet, W: Array, rounds: int = MOST_ROUNDS) -> IsometricSheet:
    """The sheet with shapes, lengths and the places of its points on the reference image adjusted together.

    Args:
        found: what its keyframes say, image by image.
        W: (F, 2, p) px, its keyframes; anything where not visible.
        rounds: of shapes with lengths, then places, at most.

    Raises:
        ReconstructionError: a part of it comes out behind the camera.
    """
    seen, shapes, placed = found.warps.weights > 0, found.shapes(), found.warps.placed
    W = np.where(seen[:, None], W, 0.0)
    rays = rays_of(W, found.camera)[:, :2, placed]
    for k in range(rounds):
        prior = found.prior_of(shapes, of_others=True)
        weights = found.weighed(shapes, W, seen)
        C = found.bundled(shapes, W, weights, prior, free=True)
        places = found.warps.reference.copy()
        slopes = found.warps.field.slopes_at(places[:, placed])[:, : C.shape[2]]
        places[:, placed] += places_moved(C, rays, weights[:, placed], found.functions[placed], slopes)
        found = found.moved(places)
        found = replace(found, log_lengths=np.median(found.lengths.now(C)[0], axis=0))  # whatever a few frames say
        usual, earlier = float(np.median(found.length_change(C))), found.usual_change
        found = replace(found, usual_change=usual, give=float(np.clip(usual, GIVE, MOST_GIVE)))
        before, shapes = shapes, C @ found.functions.T
        if np.sqrt(np.nanmean((shapes - before) ** 2)) < SETTLED * np.nanstd(before):
            break
        if k + 1 >= USUAL_ROUNDS and usual > FALLING * earlier:
            break
    return found.with_shapes(shapes)
