"""Things in a temporary file come back as they were, and share what they shared."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.files.on_disk import OnDisk


@dataclass
class Model:
    """Something large."""

    name: str


@dataclass
class Shape:
    """Something small that refers to it."""

    model: Model
    at: NDArray[np.float64]


def test_the_newest_of_each_number_comes_back_once() -> None:
    models, kept = [Model("a"), Model("b")], OnDisk[Shape](Model)
    for number in range(10):
        kept.add(number, Shape(models[number // 5], np.full(3, float(number))))
    kept.add(3, Shape(models[1], np.zeros(3)))
    kept.forget(4)
    kept.forget(100)
    found = dict(kept.taken())
    assert list(found) == [0, 1, 2, 3, 5, 6, 7, 8, 9]
    assert found[2].model is models[0]
    assert found[3].model is found[9].model is models[1]
    assert [shape.at[0] for shape in found.values()] == [0, 1, 2, 0, 5, 6, 7, 8, 9]
    assert not list(kept.taken())
