"""Places on the rectangle that things are made from: x, y, in its width; and what makes things of them."""

from collections.abc import Callable

import numpy as np

from app.arrays import Array

Shape = Callable[[Array, float], Array]  # of places (n, 2) and a time from 0 to 1: points (n, 3)
Maker = Callable[[np.random.Generator], Shape]

ASPECT = 0.75  # its height over its width


def grid(columns: int, rows: int) -> Array:
    """Places (columns·rows, 2) that cover it, row by row."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, columns), np.linspace(-0.5, 0.5, rows) * ASPECT)
    return np.column_stack([x.ravel(), y.ravel()])


def scattered(rng: np.random.Generator, count: int) -> Array:
    """Places (count, 2) on a jittered grid, in random order."""
    columns = int(np.ceil(np.sqrt(count / ASPECT)))
    rows = int(np.ceil(count / columns))
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns - 0.5, (np.arange(rows) + 0.5) / rows - 0.5)
    places = np.column_stack([x.ravel(), y.ravel()]) + rng.uniform(-0.3, 0.3, (columns * rows, 2)) / (columns, rows)
    return np.asarray(rng.permutation(places)[:count] * (1.0, ASPECT))
