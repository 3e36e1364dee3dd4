"""Straight creases of a sheet: lines on the reference image across which all other images have kinks."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from reconstruction.arrays import Array
from reconstruction.mapping.isometric.images.smooth_field import FEW_FUNCTIONS, SmoothField, smooth_field
from reconstruction.mapping.isometric.images.warps import NODES, Warps
from reconstruction.window.robust import lengths

MOST = 3
FAR = 8.0  # times the usual noise: a point is no further off its smooth image than that
CLEAR = 8.0  # times as much of what smooth functions leave over as chance takes: true creases took 9 to 60 times as much,
CLIFF = 2.0  # ... and more than so many times what the next line takes
BESIDE, LEAST = 0.05, 0.12  # of the radius beside the line, and share of the points that must lie there on either side
ANGLES, OFFSETS, FARTHEST = 36, 41, 1.6  # of lines tried, the last in units of the radius
CLOSER = 13  # angles and offsets around the best, in two rounds
STEPS = 0.09, 0.027  # rad and radii to either side in these


def creases_in(warps: Warps, W: Array) -> list[Array]:
    """Sets of creases (k, 3), see `SmoothField`, that images W (F, 2, p) px may have, few first; all finite where seen.

    After the last true one all is smooth, and no line takes nearly as much. Where bends are sharp, one line after the other
    takes a little less: there are none.
    """
    few, noise = warps.few, warps.noise_px[:, None]
    smooth = warps.images(few)
    off = np.where(warps.weights[:, None, few] > 0, W[:, :, few] - smooth, 0.0)
    off *= np.minimum(1.0, FAR * noise / np.maximum(lengths(off), 1e-300))[:, None]
    images, places = (smooth + off).reshape(-1, len(few)).T, warps.reference[:, few]
    field = smooth_field(places[:, :NODES], FEW_FUNCTIONS)
    lines, before, found = np.zeros((0, 3)), np.inf, list[Array]()
    while len(lines) <= MOST and before > CLEAR:
        known = replace(field, creases=lines).at(places)
        Q = np.linalg.qr(known)[0]
        left = images - Q @ (Q.T @ images)
        line, taken = clearest(partial(explained, places, field, Q, left))
        by_chance = max(2 * float((left**2).sum()) / max(len(few) - known.shape[1], 1), np.finfo(float).tiny)
        if len(lines) and before > CLIFF * taken / by_chance:
            found.append(lines)
        lines, before = np.concatenate([lines, in_image(line[None], field)]), taken / by_chance
    return found


def clearest(takes: Callable[[Array], Array]) -> tuple[Array, float]:
    """The line (angle, offset in radii) that takes most, and how much that is."""
    lines = grid(np.pi * np.arange(ANGLES) / ANGLES, np.linspace(-FARTHEST, FARTHEST, OFFSETS))
    best = lines[takes(lines).argmax()]
    for step in STEPS:
        lines = grid(*(best[:, None] + step * np.linspace(-1, 1, CLOSER)))
        taken = takes(lines)
        best = lines[taken.argmax()]
    return best, float(taken.max())


def grid(angles: Array, offsets: Array) -> Array:
    """All lines (n, 2) of such angles and offsets."""
    return np.stack(np.meshgrid(angles, offsets, indexing="ij"), axis=-1).reshape(-1, 2)


def explained(places: Array, field: SmoothField, Q: Array, left: Array, lines: Array) -> Array:
    """How much (n,) of what is left over of images (m, 2F) the functions of each of the lines (n, 2) would take.

    Args:
        places: (2, m) px.
        field: whose centre and radius count.
        Q: (m, r) orthonormal functions there that are known already.
        left: as above.
        lines: angles and offsets, as above.
    """
    d, t = replace(field, creases=in_image(lines, field)).beside(places)
    both = np.minimum((d > BESIDE).mean(axis=0), (d < -BESIDE).mean(axis=0)) > LEAST
    first, second = (f - Q @ (Q.T @ f) for f in (np.abs(d), np.abs(d) * t))
    first /= np.maximum(np.linalg.norm(first, axis=0), 1e-9)
    second -= first * (first * second).sum(axis=0)
    second /= np.maximum(np.linalg.norm(second, axis=0), 1e-9)
    return np.asarray(both * sum(((f.T @ left) ** 2).sum(axis=1) for f in (first, second)))


def in_image(lines: Array, field: SmoothField) -> Array:
    """Lines (n, 2), angle and offset, as creases (n, 3) in the units of the image."""
    across = np.stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])], axis=1)
    return np.column_stack([across, lines[:, 1] * field.radius + across @ field.centre])
