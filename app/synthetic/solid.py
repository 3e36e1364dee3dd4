"""Solids from their front: box, can, head; all around: a drum; a balloon that swells; and what makes them live or chew.

A place is (x, y) on a rectangle of width 1; its shape is a point (x, y, z) with z to the back.
"""

import numpy as np

from app.arrays import Array
from app.synthetic.sheet import bent, folded

ACROSS = 0.0  # bent from left to right
HINGE = 0.45  # how far behind the front a jaw's axis is
PULLED = 0.18  # how far around its centre a pull reaches, of the width


def box(places: Array) -> Array:
    """Two faces of a box that meet at a right angle in the middle."""
    return folded(places, ACROSS, np.pi / 2)


def can(places: Array) -> Array:
    """The front of a round can."""
    return bent(places, ACROSS, lambda arc: 2.4 * arc)


def chest(places: Array, out: Array) -> Array:
    """The front of a round body, its skin so far (n,) outwards."""
    turned = 2.0 * places[:, 0]
    return bent(places, ACROSS, lambda arc: 2.0 * arc) + out[:, None] * np.column_stack(
        [np.sin(turned), np.zeros(len(places)), -np.cos(turned)]
    )


def drum(places: Array) -> Array:
    """A round can, all around it."""
    return bent(places, ACROSS, lambda arc: 6.2 * arc)


def head(places: Array) -> Array:
    """Like a face: part of an ellipsoid, with brow, nose and chin."""
    x, y = places.T
    z = 1.1 * x**2 + 0.9 * y**2
    for height, x0, y0, wide, tall in ((0.16, 0, 0.02, 0.07, 0.13), (0.05, 0, -0.2, 0.25, 0.05), (0.06, 0, 0.3, 0.1, 0.06)):
        z -= height * np.exp(-(((x - x0) / wide) ** 2) - ((y - y0) / tall) ** 2)
    return np.column_stack([0.8 * x, y, z])


def balloon(places: Array, blown: float) -> Array:
    """A dome that swells: it keeps neither lengths nor shape; `blown` of 0 is flat, 1 a half ball."""
    squared = (places**2).sum(axis=1)
    wider = 1 + 0.25 * blown
    return np.column_stack([places * wider, -0.4 * blown * np.exp(-squared / 0.2)])


def hinged(points: Array, below: float, angle: float) -> Array:
    """Points (n, 3), those with a greater y turned about an axis from left to right behind them, as a jaw is."""
    c, s = np.cos(angle), np.sin(angle)
    axis = np.array([0.0, below, HINGE])
    turned = (points - axis) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T + axis
    return np.where(points[:, 1:2] > below, turned, points)


def pulled(points: Array, centres: Array, ways: Array) -> Array:
    """Points (n, 3), pulled the ways (k, 3) at centres (k, 2) in the picture, and around them less and less."""
    near = np.exp(-((points[:, None, :2] - centres) ** 2).sum(axis=2) / (2 * PULLED**2))
    return np.asarray(points + near @ ways)
