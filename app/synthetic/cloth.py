"""Cloth that hangs and flaps, by small steps of position-based dynamics (Macklin et al. 2019, "Small Steps in Physics").

The unit of length is the cloth's width, that of time a second; x goes right, y down, z to the back.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import RectBivariateSpline

from app.arrays import Array, Flags
from app.synthetic.places import grid

COLUMNS, ROWS = 41, 31  # of its mesh
STEPS = 40  # of a thirtieth of a second
RATE = 30.0  # a second
FRAMES = 120  # that are watched, thirty a second
WARM_UP = 20  # thirtieths of a second before it is watched
GRAVITY = np.array([0.0, 2.5, 0.0])
DRAG = 4.0  # what a unit of air speed across the cloth gives of acceleration
BENDING, SHEAR = 0.1, 0.5  # share of what a step would have to undo that it does; of lengths all of it
# How many rows down and columns to the right a vertex's neighbours are, and how much holds it to them.
NEIGHBOURS = ((0, 1, 1.0), (1, 0, 1.0), (1, 1, SHEAR), (1, -1, SHEAR), (0, 2, BENDING), (2, 0, BENDING))

Vector = Callable[[float], Array]  # of a time in s
Places = tuple[Any, ...]  # rows and columns of the mesh, as NumPy takes them


@dataclass(frozen=True)
class Springs:
    """Pairs of vertices that share none, so that they can be moved at once.

    Attributes:
        first, second: views (3, r, c) of the vertices.
        rest: (r, c) their distances at rest.
        moves_first, moves_second: (r, c) how much of a pair's error each takes.
    """

    first: Array
    second: Array
    rest: Array
    moves_first: Array
    moves_second: Array

    def pull(self) -> None:
        """Move them towards their distances."""
        apart = self.second - self.first
        apart *= 1 - self.rest / norm(apart)
        np.add(self.first, self.moves_first * apart, out=self.first)
        np.subtract(self.second, self.moves_second * apart, out=self.second)


def norm(X: Array) -> Array:
    """Lengths (r, c) of vectors (3, r, c)."""
    return np.asarray(np.sqrt(X[0] ** 2 + X[1] ** 2 + X[2] ** 2))


def net() -> Array:
    """Vertices (3, ROWS, COLUMNS) of the flat cloth."""
    x, y = grid(COLUMNS, ROWS).T.reshape(2, ROWS, COLUMNS)
    return np.stack([x, y, np.zeros_like(x)])


def held_at(places: Places) -> Flags:
    """Which vertices (ROWS, COLUMNS) are at some rows and columns of the mesh."""
    held = np.zeros((ROWS, COLUMNS), np.bool_)
    held[places] = True
    return held


def gusts(rng: np.random.Generator, mean: tuple[float, float, float], sway: tuple[float, float, float]) -> Vector:
    """A vector that sways about its mean, by three waves of random length and phase along each axis."""
    begun, pace = rng.uniform(0, 2 * np.pi, (3, 3)), rng.uniform(0.3, 2.0, (3, 3))
    return lambda time: np.asarray(mean + sway * np.sin(2 * np.pi * pace * time + begun).mean(axis=0))


def filmed(held: Flags, hand: Vector, wind: Vector) -> Callable[[Array, float], Array]:
    """What gives places (n, 2) of a cloth at a time from 0 to 1 their points (n, 3); see `simulated`."""
    shapes = simulated(held, hand, wind)
    x, y, _ = net()

    def shape(places: Array, time: float) -> Array:
        at = time * (len(shapes) - 1)
        first = min(int(at), len(shapes) - 2)
        now = shapes[first] + (at - first) * (shapes[first + 1] - shapes[first])
        return np.column_stack([RectBivariateSpline(y[:, 0], x[0], one).ev(places[:, 1], places[:, 0]) for one in now])

    return shape


def simulated(held: Flags, hand: Vector, wind: Vector) -> Array:
    """Shapes (FRAMES, 3, ROWS, COLUMNS), thirty a second.

    Args:
        held: (ROWS, COLUMNS) vertices that are where the hand has them.
        hand: by how much (3,) it has moved; or (3, n), each of the n vertices held.
        wind: velocity (3,).
    """
    flat = net()
    X, V, step = flat.copy(), np.zeros_like(flat), 1 / (RATE * STEPS)
    springs = list(pairs(X, flat, ~held))
    shapes = []
    for tick in range(-WARM_UP * STEPS, FRAMES * STEPS):
        time = tick * step
        if tick >= 0 and tick % STEPS == 0:
            shapes.append(X.copy())
        normal = np.cross(np.gradient(X, axis=1), np.gradient(X, axis=2), axis=0)
        normal /= norm(normal)
        across = ((wind(time)[:, None, None] - V) * normal).sum(axis=0)
        V += step * (GRAVITY[:, None, None] + DRAG * np.sign(across) * np.sqrt(np.abs(across)) * normal)
        before = X.copy()
        X += step * V
        X[:, held] = flat[:, held] + hand(time).reshape(3, -1)
        for spring in springs:
            spring.pull()
        V = (X - before) / step
    return np.stack(shapes)


def pairs(X: Array, flat: Array, free: Flags) -> Iterator[Springs]:
    """Springs between vertices beside each other, across, and beyond the next, as views of X (3, ROWS, COLUMNS)."""
    weight = free.astype(np.float64)
    for down, right, strength in NEIGHBOURS:
        both = [tuple(slice(max(way, 0), min(way, 0) or None) for way in (s * down, s * right)) for s in (-1, 1)]
        axis, reach = (0, down) if down else (1, right)
        for phase in range(2 * reach):
            every = tuple(slice(phase, None, 2 * reach) if k == axis else slice(None) for k in range(2))
            (first, here, w), (second, there, v) = (
                [of[..., *end][..., *every] for of in (X, flat, weight)] for end in both
            )
            share = strength / np.maximum(w + v, 1.0)
            yield Springs(first, second, norm(there - here), share * w, share * v)
