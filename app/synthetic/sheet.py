"""Shapes of a sheet that keeps all lengths: bent along parallel lines, along lines through a point, folded, or torn.

A place on the flat sheet is (x, y), its shape a point (x, y, z) with z to the back; the unit is the sheet's width.
"""

from collections.abc import Callable

import numpy as np

from app.arrays import Array

Slope = Callable[[Array], Array]  # of a place across the lines: the angle, in rad, by which the sheet leaves its plane
STEPS = 4000
REACH = 1.0  # across the lines, to both sides


def bent(places: Array, along_rad: float, slope: Slope) -> Array:
    """Shape (n, 3) of places (n, 2) on a sheet that is curved in one direction and straight across it."""
    c, s = np.cos(along_rad), np.sin(along_rad)
    across, straight = places @ (c, s), places @ (-s, c)
    arc = np.linspace(-REACH, REACH, STEPS + 1)
    angle = slope(0.5 * (arc[1:] + arc[:-1]))
    # A chain of short straight pieces: all lengths are exact.
    chain = np.concatenate([np.zeros((1, 2)), np.cumsum(np.stack([np.cos(angle), np.sin(angle)], axis=1), axis=0)])
    chain *= 2 * REACH / STEPS
    out, deep = (np.interp(across, arc, chain[:, k] - chain[STEPS // 2, k]) for k in range(2))
    return np.stack([c * out - s * straight, s * out + c * straight, deep], axis=1)


def coned(places: Array, apex: Array, bend_rad: float) -> Array:
    """Shape (n, 3) of places (n, 2) on a sheet rolled into part of a circular cone.

    Args:
        places: on the flat sheet.
        apex: (2,) where the cone's straight lines meet, off the sheet.
        bend_rad: angle between cone and axis, 0 to π/2; π/2 leaves the sheet flat.
    """
    radius, angle = np.hypot(*(places - apex).T), turned_from(apex, places)
    narrow = np.sin(bend_rad)
    around = angle / narrow
    to_middle = -apex / np.hypot(*apex)
    aside = np.array([-to_middle[1], to_middle[0]])
    out = radius * (np.sin(bend_rad) ** 2 * np.cos(around) + np.cos(bend_rad) ** 2)
    side = radius * narrow * np.sin(around)
    deep = radius * narrow * np.cos(bend_rad) * (1 - np.cos(around))
    return np.column_stack([apex + out[:, None] * to_middle + side[:, None] * aside, deep])


def turned_from(apex: Array, places: Array) -> Array:
    """Angles (n,) at the apex between the sheet's middle and places (n, 2)."""
    to = places - apex
    return np.arctan2(-apex[0] * to[:, 1] + apex[1] * to[:, 0], -to @ apex)


def folded(places: Array, along_rad: float, fold_rad: float) -> Array:
    """Shape (n, 3) of places (n, 2) on a sheet with a crease through its middle, each half turned back by half the fold."""
    return bent(places, along_rad, lambda arc: np.sign(arc) * fold_rad / 2)


def opened(places: Array, along_rad: float, back: float, fold_rad: float, bends: Array) -> Array:
    """Shape (n, 3) of places (n, 2) on a book, each page turned back by so much where its back is, and bent (2,)."""
    return bent(places, along_rad, lambda arc: np.sign(arc - back) * fold_rad + np.where(arc < back, *bends) * (arc - back))


def torn(places: Array, down_to: float, bend: float) -> Array:
    """Shape (n, 3) of places (n, 2) on a sheet torn in its middle from above down to a y, each half bent there by so much.

    The left half goes to the back, the right one to the front; `bend` is the curvature, in rad over the sheet's width.
    """
    x, y = places.T
    above = np.maximum(down_to - y, 0.0)
    return np.column_stack([x, y + above - np.sin(bend * above) / bend, -np.sign(x) * (1 - np.cos(bend * above)) / bend])
