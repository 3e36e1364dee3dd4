"""A sheet that bends and does not stretch, from its keyframes alone: isometric adjustment along the rays.

No rest shape is needed: of all smooth depths along the rays, those under which every line between neighbours is as long in
all keyframes. It needs a perspective camera; `focal` looks for its focal length.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.bundle import FINE_FUNCTIONS as FINE_SHAPES
from reconstruction.mapping.isometric.bundle import places_moved
from reconstruction.mapping.isometric.convex import convex_finish, convex_start, parts_of
from reconstruction.mapping.isometric.lengths import (
    Edges,
    Solver,
    adjust_depths,
    best_start,
    finish_depths,
    mean_log_lengths,
    robust_lengths,
    usual,
)
from reconstruction.mapping.isometric.nodes import Nodes, edges_between, nearest, nodes_of, on_edges, rays_of
from reconstruction.mapping.isometric.one_frame import mended
from reconstruction.mapping.isometric.shape_prior import FIRM, ROUGH
from reconstruction.mapping.isometric.sheet import IsometricSheet, described
from reconstruction.mapping.isometric.smooth_field import smooth_field
from reconstruction.mapping.isometric.warps import Warps, finer, smooth_warps
from reconstruction.window.robust import geman_mcclure

FUNCTIONS, FINE_FUNCTIONS = 40, 60
START_FRAMES = 10  # of the convex start
BUNDLE_ROUNDS = 12  # of shapes, then places and lengths: with much noise they are still getting better
FEW_ROUNDS = 2  # bring most of that in a tenth of a second
ROUGH_ROUNDS = 2  # in which shapes and lengths lose their noise; after those, lengths go on the way they went
GOING_ON = 0.7  # of the way of the round before: alone, each round goes a part of it only
SETTLED = 2e-4  # of the shapes' size: a round that moves them less is the last
ROUNDS = 6  # at most, of starting frames again that do not fit
OTHER_STARTS = 2
FIRM_START = 100.0  # times the bending weight, before it is let go
DOUBTFUL = 3.0  # times the usual change of length
LITTLE_CHANGE = 0.006  # usual change of length, with which a start is good
TORN = 2.5  # the worst edges' change over the usual one: strays spoil the start
LITTLE_GAIN = 0.1  # of the change: a round that brought less is the last
MOST_CHANGE = 0.06  # of lengths, rms, noise apart: no cloth seems to, with folds cut off; less is weighed against a solid
MOST_AT_ALL = 0.08  # with noise: what is that far off smooth images is not noise
MOST_PARALLAX = 0.01  # over the image's RMS radius: true sheets up to 0.5 %, by noise; what is seen through 1.5 % and more
SOLVER = Solver()


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
    if not camera.perspective:
        raise ReconstructionError("a sheet's depths along its rays need a perspective camera")
    warps = smooth_warps(W, visible)
    if len(W) < 3 or warps.placed.sum() < 20:
        raise ReconstructionError("a sheet of unknown shape needs 3 keyframes and 20 points")
    if (parallax := warps.parallax_over_size(W, visible)) > MOST_PARALLAX:
        raise ReconstructionError(f"no smooth surface: points are {parallax:.1%} of its size off it, together")
    return on_smooth_images(warps, camera)


def on_smooth_images(warps: Warps, camera: Camera) -> IsometricSheet:
    """The sheet that is seen in smooth images.

    Raises:
        ReconstructionError: no depths keep the lengths.
    """
    nodes = nodes_of(warps)
    field = smooth_field(nodes.reference, FUNCTIONS)
    values = warps.values_of(field)
    seen = edges_between(nodes, on_edges(nodes, field), camera)
    c = first_depths(nodes, seen, values[nodes.points], field.stiffness, camera)
    factor, change = np.ones(len(nodes.ends)), np.inf
    for _ in range(ROUNDS):
        c, factor = again(nodes, seen, seen.weighted(factor), c, values[nodes.points], field.stiffness, camera)
        before, found = change, described(warps, nodes, field, values, c, factor, camera, SOLVER.bend)
        change = found.strain_rms
        if change > (1 - LITTLE_GAIN) * before:
            break
    if found.strain_beyond_noise > MOST_CHANGE or change > MOST_AT_ALL:
        raise ReconstructionError(f"no sheet of one metric: lengths change by {change:.1%}")
    return found


def by_part(found: IsometricSheet, part: Indices) -> IsometricSheet:
    """The sheet by some of its frames alone: depths and lengths adjusted anew from those there are."""
    nodes = found.nodes.in_frames(part)
    edges = found.edges_in(nodes)
    c = adjust_depths(edges, found.coefficients[part], found.field.stiffness, SOLVER)
    warps = found.warps.in_frames(part)
    functions, factor = found.shape_functions, found.edge_weights
    return described(warps, nodes, found.field, found.values, c, factor, found.camera, found.bend, functions)


def in_halves(found: IsometricSheet, W: Array, halves: Sequence[Indices]) -> tuple[list[tuple[Array, Array, Array]], float]:
    """Shapes of the sheet for both halves of its keyframes W (F, 2, p) px, as model selection asks for them."""
    made = [by_part(found, half) for half in halves]
    shapes = []
    for one, other, half in zip(made, reversed(made), halves, strict=True):
        told = finish_depths(one.edges, other.log_lengths, one.coefficients, one.field.stiffness, one.bend)[0]
        shapes.append((*one.both(W[half]), one.along_rays(told, W[half])))
    return shapes, found.strain_beyond_noise


def refined(found: IsometricSheet, W: Array, visible: Mask) -> IsometricSheet:
    """The sheet of finer functions, and with more edges, started from its shapes: for bends that the usual ones cut off.

    Args:
        found: as above.
        W: (F, 2, p) px, its keyframes; anything where not visible.
        visible: (F, p).
    """
    warps = finer(found.warps, W, visible)
    nodes = nodes_of(warps, fine=True)
    field = smooth_field(nodes.reference, FINE_FUNCTIONS)
    values = warps.values_of(field)
    B, seen = values[nodes.points], edges_between(nodes, on_edges(nodes, field), found.camera)
    c = found.coefficients @ found.values[nodes.points].T @ np.linalg.pinv(B).T
    c, factor = once_more(seen, seen, c, field.stiffness)
    c, factor = again(nodes, seen, seen.weighted(factor), c, B, field.stiffness, found.camera)
    finer_one = described(warps, nodes, field, values, c, factor, found.camera, found.bend, FINE_SHAPES)
    return replace(finer_one, by_focal=found.by_focal)


def with_focal(found: IsometricSheet, focal_px: float) -> IsometricSheet:
    """The same keyframes under another focal length, adjusted from the shapes there are, edges weighted as they are."""
    return by_part(replace(found, camera=replace(found.camera, focal_px=focal_px)), np.arange(len(found.coefficients)))


def bundled(found: IsometricSheet, W: Array, rounds: int = BUNDLE_ROUNDS) -> IsometricSheet:
    """The sheet with shapes, lengths and the places of its points on the reference image adjusted together.

    Args:
        found: what its keyframes say, image by image.
        W: (F, 2, p) px, its keyframes; anything where not visible.
        rounds: of shapes, then places and lengths.

    Raises:
        ReconstructionError: a part of it comes out behind the camera.
    """
    seen, shapes, placed = found.warps.weights > 0, found.shapes(), found.warps.placed
    W = np.where(seen[:, None], W, 0.0)
    rays, way = rays_of(W, found.camera)[:, :2, placed], np.zeros(len(found.log_lengths))
    for k in range(rounds):
        prior = found.prior_of(shapes, FIRM if k >= ROUGH_ROUNDS else ROUGH, of_others=True)
        if k == 0 or not found.far:
            weights = found.weighed(shapes, W, seen)
        C = found.bundled(shapes, W, weights, prior)
        places = found.warps.reference.copy()
        slopes = found.warps.field.slopes_at(places[:, placed])[:, : C.shape[2]]
        places[:, placed] += places_moved(C, rays, weights[:, placed], found.functions[placed], slopes)
        found = found.moved(places)
        way = GOING_ON * way if k >= ROUGH_ROUNDS else 0 * way
        way = way + np.median(found.lengths.now(C)[0], axis=0) - found.log_lengths
        found = replace(found, log_lengths=found.log_lengths + way)
        before, shapes = shapes, C @ found.functions.T
        if np.sqrt(np.nanmean((shapes - before) ** 2)) < SETTLED * np.nanstd(before):
            break
    C = mended(found, C, W, weights)
    return replace(found.with_shapes(C @ found.functions.T), usual_change=float(np.median(found.length_change(C))))


def first_depths(nodes: Nodes, seen: Edges, B: Array, stiffness: Array, camera: Camera) -> Array:
    """Coefficients (F, r): a convex start on the first frames, adjusted, and the others with its lengths.

    Points of something else at a border spoil the start: where lengths change much, others are tried, each from a part
    of the surface only.
    """
    frames = np.arange(len(nodes.images))
    few, rest = frames[:START_FRAMES], frames[START_FRAMES:]
    start, first = seen.frames(few), nodes.in_frames(few)
    c, least = np.zeros((0, 0)), np.inf
    for part in parts_of(nodes.reference):
        inside = start.weighted(np.asarray(part[nodes.ends].all(axis=1), np.float64))
        tried = convex_start(first, part, start, B, stiffness, camera)
        tried = adjust_depths(inside, tried, stiffness, Solver(bend=FIRM_START * SOLVER.bend))
        tried = adjust_depths(inside, tried, stiffness, SOLVER)
        tried = tried if part.all() else once_more(start, start, tried, stiffness)[0]
        g = start.log_lengths(tried)
        change = usual(g - mean_log_lengths(start, g))
        if not len(c) or change < least:
            c, least = tried, change
        by_edge = robust_lengths(start, g)[2]
        if part.all() and (least < LITTLE_CHANGE or np.quantile(by_edge, 0.95) < TORN * np.median(by_edge)):
            break
    if not len(rest):
        return c
    logs = robust_lengths(start, start.log_lengths(c))[0]
    alike = nearest(nodes.images[rest], nodes.images[few])
    starts = [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(c)))]
    return np.concatenate([c, best_start(seen.frames(rest), logs, starts, stiffness, SOLVER.bend)])


def again(
    nodes: Nodes, seen: Edges, edges: Edges, c: Array, B: Array, stiffness: Array, camera: Camera
) -> tuple[Array, Array]:
    """As `once_more`, frames that fell into another minimum started from others that did not, too.

    Raises:
        ReconstructionError: there are no such depths.
    """
    off = robust_lengths(edges, edges.log_lengths(c))[1]
    if not np.isfinite(off).all():
        raise ReconstructionError("no depths along the rays keep the lengths")
    good = np.flatnonzero(off <= np.median(off))
    alike = good[nearest(nodes.images, nodes.images[good])]
    starts = [np.tile(c[good].mean(axis=0), (len(c), 1))]
    starts += [c[alike[:, k]] for k in range(min(OTHER_STARTS, len(good)))]
    stuck = np.flatnonzero(off > np.median(off))
    if len(stuck):
        deepest, some = c.copy(), nodes.in_frames(stuck)
        deepest[stuck] = convex_finish(some, edges.frames(stuck), nodes.in_frames(good), c[good], B, stiffness, camera)
        starts.append(deepest)
    return once_more(seen, edges, c, stiffness, starts)


def once_more(seen: Edges, edges: Edges, c: Array, stiffness: Array, starts: Sequence[Array] = ()) -> tuple[Array, Array]:
    """Adjust once more, each frame from the best of its own and other starts (F, r).

    Returns:
        coefficients (F, r); factors (n,) of the edges' weights: small for those that do not keep their length.
    """
    logs, _, change = robust_lengths(edges, edges.log_lengths(c))
    factor = geman_mcclure(change / (DOUBTFUL * np.median(change) + 1e-12))
    edges = seen.weighted(factor)
    c = best_start(edges, logs, [c, *starts], stiffness, SOLVER.bend)
    c[:, 0] -= c[:, 0].mean()
    return adjust_depths(edges, c, stiffness, SOLVER), factor
