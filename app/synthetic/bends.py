"""How sheets bend: each maker makes one motion from random numbers, most of them of sheets that keep their lengths."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.arrays import Array
from app.synthetic import sheet
from app.synthetic.places import Maker, Shape


def waving(slope_rad: float) -> Maker:
    """Sheets with waves of such a slope that run through them, across lines that slowly turn; never flat."""

    def maker(rng: np.random.Generator) -> Shape:
        along, length = rng.uniform(0, np.pi), rng.uniform(0.9, 1.2)
        a, b, c = rng.uniform(0, 2 * np.pi, 3)

        def shape(places: Array, time: float) -> Array:
            t = 2 * np.pi * time
            return sheet.bent(
                places,
                along + 0.4 * np.sin(t + a),
                lambda arc: slope_rad * (0.8 + 0.2 * np.sin(2 * t + b)) * np.sin(2 * np.pi * arc / length + 2 * t + c),
            )

        return shape

    return maker


def swaying(rng: np.random.Generator) -> Shape:
    """A curtain, turned a little away, with folds that the draught moves, less near the rod; it stretches by up to 3 %."""
    side, (a, b, c) = rng.uniform(0.3, 0.5) * rng.choice([-1, 1]), rng.uniform(0, 2 * np.pi, 3)
    turned = Rotation.from_rotvec([0.0, side, 0.0]).as_matrix()

    def shape(places: Array, time: float) -> Array:
        t = 4 * np.pi * time
        drawn = places * (1.0, 1.0 + 0.03 * np.sin(1.5 * t + c))
        level = flat(drawn)
        folds = sheet.bent(drawn, 0.2, lambda arc: 0.12 * np.sin(2 * np.pi * arc / 0.9 + t + a) + 0.1 * np.sin(1.3 * t + b))
        below = 0.6 + 1.1 * places[:, 1:]
        return np.asarray((level + below * (folds - level)) @ turned.T)

    return shape


def rolling(rng: np.random.Generator) -> Shape:
    """Paper that is rolled up to most of a half cylinder and back; never flat."""
    along, a = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
    return lambda places, time: sheet.bent(
        places, along + 0.2 * np.sin(2 * np.pi * time), lambda arc: (1.2 + 0.9 * np.sin(2 * np.pi * time + a)) * arc
    )


def coning(rng: np.random.Generator) -> Shape:
    """Paper that is rolled up like an ice-cream cone's, around a point that wanders off its edge."""
    side, a = rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)

    def shape(places: Array, time: float) -> Array:
        t = 2 * np.pi * time
        at = side + 0.3 * np.sin(t)
        bend = 0.8 + 0.3 * np.sin(2 * t + a)
        return sheet.coned(places, 1.0 * np.array([np.cos(at), np.sin(at)]), bend)

    return shape


def creasing(rng: np.random.Generator) -> Shape:
    """A card with a crease that opens and closes."""
    along, a = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
    return lambda places, time: sheet.folded(places, along, 0.9 + 0.6 * np.sin(4 * np.pi * time + a))


def leafing(rng: np.random.Generator) -> Shape:
    """A book that opens and shuts, its back off the middle, its pages bent each in its own way."""
    along, back, (a, b, c) = rng.uniform(0, np.pi), rng.uniform(-0.12, 0.12), rng.uniform(0, 2 * np.pi, 3)
    return lambda places, time: sheet.opened(
        places, along, back, 0.7 + 0.45 * np.sin(4 * np.pi * time + a), 0.6 * np.sin(5.2 * np.pi * time + np.array([b, c]))
    )


def lifted(rng: np.random.Generator) -> Shape:
    """A page that is lifted at one side, and let down: flat where it is held, it bends to one side alone."""
    along = rng.uniform(-0.4, 0.4)
    return lambda places, time: sheet.bent(
        places, along, lambda arc: -1.3 * np.sin(np.pi * time) ** 2 * np.clip((arc + 0.25) / 0.35, 0, 1)
    )


def drawn_out(rng: np.random.Generator) -> Shape:
    """Rubber that is drawn out by up to 40 % and let go, a third of that narrower meanwhile, a little bent."""
    along, a = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)

    def shape(places: Array, time: float) -> Array:
        longer = 0.2 * (1 + np.sin(4 * np.pi * time + a))
        return sheet.bent(places * (0.8 * (1 + longer), 1 - longer / 3), along, lambda arc: 0.8 * np.sin(2 * arc))

    return shape


def tearing(rng: np.random.Generator) -> Shape:
    """Paper that is torn from its upper edge down, one half bent to the front, the other to the back."""
    begun, bend = rng.uniform(-0.3, -0.2), rng.uniform(1.0, 2.0)
    return lambda places, time: sheet.torn(places, begun + 0.45 * time, bend)


def flat(places: Array) -> Array:
    """A card."""
    return np.column_stack([places, np.zeros(len(places))])
