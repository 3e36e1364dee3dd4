"""Keyframes of a sheet seen without perspective, each in that of its shapes which is likeliest by those of the others.

What slopes one way or the other looks alike: a keyframe's image fits several shapes about as well, whole and in parts
mirrored in depth. Sheets take shapes of one kind, and mirrored parts are of another.
"""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Indices
from reconstruction.mapping.isometric.bundle import MOST_GIVE
from reconstruction.mapping.isometric.lengths import finish_depths
from reconstruction.mapping.isometric.nodes import nearest, rays_of
from reconstruction.mapping.isometric.shape_prior import shape_prior
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.isometric.starts import distinct

STARTS, STEPS = 20, 8  # keyframes that each is started from, and mirrored, and steps of its depths
AS_WELL, ENOUGH = 2.0, 0.001  # times the least change of lengths, and more, by which shapes fit as well
ALIKE = 0.08  # of the depth's relief: shapes that differ by less, or their mirror images do, are one
MOST = 6  # different ones of a keyframe, and their mirror images
ROUNDS = 4  # at most, of asking all others about each


@dataclass(frozen=True)
class Fitting:
    """Shapes that fit one keyframe: coefficients of log depths (n, r), shapes (n, 3, R), changes of length (n,)."""

    coefficients: Array
    shapes: Array
    changes: Array


def likeliest(found: IsometricSheet) -> IsometricSheet:
    """The sheet, each keyframe in the likeliest of the shapes that fit it.

    They are added one by one, always the one that looks most like one of those before, and asked again once all are there.
    """
    images = found.warps.images(found.warps.few)
    fitting = [fitting_shapes(found, k, image) for k, image in enumerate(images)]
    C = np.stack([one.shapes[0] for one in fitting])
    few, chosen = found.functions[found.warps.few], np.zeros(len(C), np.int64)
    weight = found.edge_weights.sum() / MOST_GIVE**2

    def choose(k: int, others: Indices) -> bool:
        prior = shape_prior(C[others], few, found.lengths.stiffness, of_others=False)
        before, chosen[k] = chosen[k], (weight * fitting[k].changes ** 2 + prior.cost(fitting[k].shapes)).argmin()
        C[k] = fitting[k].shapes[chosen[k]]
        return bool(chosen[k] != before)

    looks = found.nodes.images - found.nodes.images.mean(axis=2, keepdims=True)
    order = most_alike_first(looks.reshape(len(C), -1), int((C[:, 2] @ few.T).std(axis=1).argmax()))
    for n, k in enumerate(order[1:], 1):
        choose(k, order[:n])
    for _ in range(ROUNDS):
        if not sum(choose(k, order[order != k]) for k in order):
            break
    return replace(found, coefficients=np.stack([one.coefficients[k] for one, k in zip(fitting, chosen, strict=True)]))


def fitting_shapes(found: IsometricSheet, k: int, image: Array) -> Fitting:
    """Shapes that fit keyframe k, the one that keeps lengths best first: started from those of its look-alikes.

    Args:
        found: as above.
        k: as above.
        image: (2, m) px, where it shows the few points that tell shapes.
    """
    B = found.values[found.nodes.points]
    alike = found.coefficients[nearest(found.nodes.images[[k]], found.nodes.images)[0, :STARTS]]
    starts = np.concatenate([alike, mirrored(alike, B)])
    edges = found.edges.frames(np.full(len(starts), k))
    c = finish_depths(edges, found.log_lengths, starts, found.field.stiffness, found.solver.bend, STEPS)[0]
    changes = edges.rms(edges.log_lengths(c) - found.log_lengths)
    order = changes.argsort()
    order = order[changes[order] <= AS_WELL * changes.min() + ENOUGH]
    kept = order[distinct(c[order] @ B.T, ALIKE, mirrored=True)[:MOST]]
    c = np.concatenate([c[kept], mirrored(c[kept], B)])
    depths = np.exp(c @ found.values[found.warps.few].T)
    shapes = depths[:, None] * rays_of(image[None], found.camera) @ found.projector
    return Fitting(c, shapes, np.tile(changes[kept], 2))


def mirrored(c: Array, B: Array) -> Array:
    """Coefficients (n, r) of log depths B c mirrored about their mean; the first of the functions B (m, r) is constant."""
    other = -c
    other[:, 0] += 2 * (c @ B.T).mean(axis=1) / B[0, 0]
    return other


def most_alike_first(images: Array, first: int) -> Indices:
    """Indices of images (F, n): the first one, and always the one that is most like one of those before it."""
    order, away = [first], np.full(len(images), np.inf)
    while len(order) < len(images):
        away = np.minimum(away, np.linalg.norm(images - images[order[-1]], axis=1))
        away[order] = np.inf
        order.append(int(away.argmin()))
    return np.array(order)
