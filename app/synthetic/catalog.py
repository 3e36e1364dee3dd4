"""The kinds of things, and which of them nobody may tune on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from app.arrays import Array
from app.synthetic import cloth, sheet, solid
from app.synthetic.path import Path

Shape = Callable[[Array, float], Array]  # of places (n, 2) and a time from 0 to 1: points (n, 3)
Maker = Callable[[np.random.Generator], Shape]
UPPER_CORNERS = 0, [0, -1]  # of a cloth's mesh
JAW, LID = 0.12, 0.28  # where the mouth is, down from the middle of a head; where a box's lid is hung
HELD_SEEDS = 100  # seeds from this one on are held back


@dataclass(frozen=True)
class Kind:
    """A kind of thing.

    Attributes:
        what: what a reconstruction should take it for; "" where it has no word for it.
        shape: makes one from random numbers.
        turn_deg: least and greatest turn.
        late: share of the video in which it is held almost still at first.
        held_back: not for tuning, with any seed.
    """

    what: Literal["sheet", "solid", "flat", ""]
    shape: Maker
    turn_deg: tuple[float, float]
    late: float = 0.0
    held_back: bool = False

    def path(self, rng: np.random.Generator) -> Path:
        """A path for one of them, from so near that perspective shows."""
        return Path(float(rng.uniform(*self.turn_deg)), self.late, 2.2, rng.uniform(0, 2 * np.pi, 6))


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


def flapping(rng: np.random.Generator) -> Shape:
    """A flag on a pole at its left, in a wind that turns."""
    pole = cloth.held_at((slice(None), 0))
    return cloth.filmed(pole, lambda _: np.zeros(3), cloth.gusts(rng, (8.0, -1.0, 0.0), (1.5, 0.8, 1.2)))


def shaken(rng: np.random.Generator) -> Shape:
    """A cloth held by its upper corners and shaken, in a draught."""
    corners = cloth.held_at(UPPER_CORNERS)
    hand = cloth.gusts(rng, (0.0, 0.0, 0.0), (0.02, 0.02, 0.05))
    return cloth.filmed(corners, hand, cloth.gusts(rng, (0.0, 0.0, 0.5), (0.5, 0.3, 0.8)))


def drawn_together(corners: cloth.Places) -> Maker:
    """Cloths held at their corners, drawn together by a tenth so that they sag between, each by a hand of its own."""

    def maker(rng: np.random.Generator) -> Shape:
        held = cloth.held_at(corners)
        inward = -0.1 * cloth.net()[:, held]
        hands = [cloth.gusts(rng, (0.0, 0.0, 0.0), (0.05, 0.05, 0.12)) for _ in range(held.sum())]
        return cloth.filmed(
            held,
            lambda time: inward + np.column_stack([hand(time) for hand in hands]),
            cloth.gusts(rng, (0.0, 0.0, 0.4), (0.3, 0.2, 0.5)),
        )

    return maker


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


def swelling(rng: np.random.Generator) -> Shape:
    """A balloon that is blown up and let out."""
    a = rng.uniform(0, 2 * np.pi)
    return lambda places, time: solid.balloon(places, 0.55 - 0.4 * np.cos(3 * np.pi * time + a))


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


def living(shape: Callable[[Array], Array], pull: float) -> Maker:
    """Solids that are pulled so far at four places, of their width, again and again, each at its own pace."""

    def maker(rng: np.random.Generator) -> Shape:
        centres, ways = rng.uniform(-0.4, 0.4, (4, 2)), rng.normal(size=(4, 3))
        ways *= pull / np.linalg.norm(ways, axis=1, keepdims=True)
        pace, begun = rng.uniform(2, 6, 4), rng.uniform(0, 2 * np.pi, 4)

        def changed(places: Array, time: float) -> Array:
            course = np.sin(2 * np.pi * pace * time + begun)
            return solid.pulled(shape(places), centres, course[:, None] * ways)

        return changed

    return maker


def worn(rng: np.random.Generator) -> Shape:
    """A shirt on a chest that breathes: folds travel over it, far finer than it is."""
    a, b = rng.uniform(0, 2 * np.pi, 2)

    def shape(places: Array, time: float) -> Array:
        waves = np.sin(2 * np.pi * (places @ (2.5, 3.0)) + 4 * np.pi * time + a)
        return solid.chest(places, 0.015 * (1 + np.sin(3 * np.pi * time + b)) * waves) * (
            1 + 0.02 * np.sin(5 * np.pi * time)
        )

    return shape


def chewing(rng: np.random.Generator) -> Shape:
    """A head whose jaw, a third of it, opens and shuts: two rigid parts beside each other."""
    pace, a = rng.uniform(3, 5), rng.uniform(0, 2 * np.pi)

    def shape(places: Array, time: float) -> Array:
        return solid.hinged(solid.head(places), JAW, 0.25 * (1 + np.sin(2 * np.pi * pace * time + a)))

    return shape


def opening(rng: np.random.Generator) -> Shape:
    """A box whose lid, a fifth of it, opens and shuts: most points tell of no change at all."""
    pace, a = rng.uniform(2, 4), rng.uniform(0, 2 * np.pi)

    def shape(places: Array, time: float) -> Array:
        return solid.hinged(solid.box(places), LID, 0.5 * (1 + np.sin(2 * np.pi * pace * time + a)))

    return shape


def still(shape: Callable[[Array], Array]) -> Maker:
    """Things that do not change."""
    return lambda _: lambda places, _time: shape(places)


def flat(places: Array) -> Array:
    """A card."""
    return np.column_stack([places, np.zeros(len(places))])


def heart(places: Array) -> Array:
    """A dome."""
    return solid.balloon(places, 0.8)


SHEET_TURN, SOLID_TURN = (10.0, 25.0), (25.0, 40.0)
KINDS = {
    "waving-3": Kind("sheet", waving(0.3), SHEET_TURN),
    "waving-5": Kind("sheet", waving(0.5), SHEET_TURN),
    "waving-7": Kind("sheet", waving(0.7), SHEET_TURN),
    "waving-9": Kind("sheet", waving(0.9), SHEET_TURN),
    "rolling": Kind("sheet", rolling, SHEET_TURN),
    "curtain": Kind("sheet", swaying, (0.5, 1.0)),
    "cloth": Kind("sheet", shaken, SHEET_TURN),
    "flag": Kind("sheet", flapping, SHEET_TURN),
    "towel": Kind("sheet", drawn_together(UPPER_CORNERS), SHEET_TURN),
    "blanket": Kind("sheet", drawn_together(np.ix_([0, -1], [0, -1])), SHEET_TURN),
    "book": Kind("sheet", leafing, SHEET_TURN),
    "cone": Kind("sheet", coning, SHEET_TURN, held_back=True),
    "crease": Kind("sheet", creasing, SHEET_TURN, held_back=True),
    "card": Kind("flat", still(flat), SOLID_TURN),
    "box": Kind("solid", still(solid.box), SOLID_TURN),
    "box-late": Kind("solid", still(solid.box), SOLID_TURN, late=0.5),
    "head": Kind("solid", still(solid.head), SOLID_TURN),
    "head-late": Kind("solid", still(solid.head), SOLID_TURN, late=0.5),
    "talking-head": Kind("solid", living(solid.head, 0.06), SOLID_TURN),
    "chewing-head": Kind("solid", chewing, SOLID_TURN),
    "opening-box": Kind("solid", opening, SOLID_TURN),
    "shirt": Kind("solid", worn, SOLID_TURN),
    "heart": Kind("solid", living(heart, 0.1), SHEET_TURN),
    "can": Kind("solid", still(solid.can), SOLID_TURN, held_back=True),
    "drum": Kind("solid", still(solid.drum), (120.0, 180.0)),
    "balloon": Kind("", swelling, SOLID_TURN),
    "rubber": Kind("", drawn_out, SOLID_TURN, held_back=True),
    "tear": Kind("", tearing, SOLID_TURN, held_back=True),
}
