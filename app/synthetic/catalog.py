"""The kinds of things, and which of them nobody may tune on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.arrays import Array
from app.synthetic import bends, cloth, solid
from app.synthetic.path import Path
from app.synthetic.places import Maker, Shape

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


def swelling(rng: np.random.Generator) -> Shape:
    """A balloon that is blown up and let out."""
    a = rng.uniform(0, 2 * np.pi)
    return lambda places, time: solid.balloon(places, 0.55 - 0.4 * np.cos(3 * np.pi * time + a))


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


def heart(places: Array) -> Array:
    """A dome."""
    return solid.balloon(places, 0.8)


SHEET_TURN, SOLID_TURN = (10.0, 25.0), (25.0, 40.0)
KINDS = {
    "waving-3": Kind("sheet", bends.waving(0.3), SHEET_TURN),
    "waving-5": Kind("sheet", bends.waving(0.5), SHEET_TURN),
    "waving-7": Kind("sheet", bends.waving(0.7), SHEET_TURN),
    "waving-9": Kind("sheet", bends.waving(0.9), SHEET_TURN),
    "rolling": Kind("sheet", bends.rolling, SHEET_TURN),
    "curtain": Kind("sheet", bends.swaying, (0.5, 1.0)),
    "cloth": Kind("sheet", shaken, SHEET_TURN),
    "flag": Kind("sheet", flapping, SHEET_TURN),
    "towel": Kind("sheet", drawn_together(UPPER_CORNERS), SHEET_TURN),
    "blanket": Kind("sheet", drawn_together(np.ix_([0, -1], [0, -1])), SHEET_TURN),
    "book": Kind("sheet", bends.leafing, SHEET_TURN),
    "page": Kind("sheet", bends.lifted, SHEET_TURN),
    "cone": Kind("sheet", bends.coning, SHEET_TURN, held_back=True),
    "crease": Kind("sheet", bends.creasing, SHEET_TURN, held_back=True),
    "card": Kind("flat", still(bends.flat), SOLID_TURN),
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
    "rubber": Kind("", bends.drawn_out, SOLID_TURN, held_back=True),
    "tear": Kind("", bends.tearing, SOLID_TURN, held_back=True),
}
