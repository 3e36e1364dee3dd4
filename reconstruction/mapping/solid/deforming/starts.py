"""Where learning a solid's deformations begins: its modes, and a pose and Λ' of each keyframe."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RigidMotion, apart
from reconstruction.camera import nearest_rotation
from reconstruction.mapping.factorization import rotations_from_rows
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.bundle import Bundle, seen_by
from reconstruction.mapping.solid.deforming.deformations import Learned
from reconstruction.mapping.solid.deforming.learning import POINTS, ROUNDS, learned
from reconstruction.mapping.solid.deforming.low_rank import posed
from reconstruction.mapping.solid.deforming.own_motion import own_motion
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.mapping.start import Start as Begin
from reconstruction.mapping.start import at_once
from reconstruction.settings import MOST_MODES, USUAL_MODES, Settings
from reconstruction.state import State, join
from reconstruction.window.energy import build_energy
from reconstruction.window.window import SlidingWindow

STARTS = (2, 10.0), (4, 10.0), (2, 1e3), (3, 1e3)  # so many shapes; points so many deviations off may be wrong, or swing
FEW_POINTS = 100  # by which it is seen whether they have
DEPTHS = 0.5, 0.7  # times as deep as the rigid shape
LIKELIER = 0.15  # of minus the log likelihood of an image point: less is for errors of tracks


@dataclass(frozen=True)
class Start:
    """Where learning begins.

    Attributes:
        model: a mean shape with its modes.
        known: what keyframes tell with them.
        log_s: (K,) to which scales are held.
    """

    model: Model
    known: Learned
    log_s: Array

    @property
    def unlikeliness(self) -> float:
        """Minus the log likelihood of an image point in px."""
        return self.known.unlikeliness + 2 * float(np.log(self.model.radius_px))


def likeliest(
    start: Start, rigid: Map, settings: Settings, W: Array, visible: Mask, sound: Mask, begin: Begin = at_once
) -> tuple[Start, float]:
    """The same, or one about another mean shape, if that makes much likelier what keyframes show.

    And how far off it (`apart`) shapes are that are about as likely. Mean shapes are by factorisation (`low_rank`), or
    shallower. All are compared by few modes and few points; the rigid map and other arguments as for `begun`, and where a
    part of the work is done.
    """
    motion, camera = rigid.rest.motion, rigid.camera
    seen = W - camera.center_px[:, None], visible, Bundle(motion, 1 / camera.focal_px)
    try_one = partial(tried, rigid, settings, W, visible, sound)
    factors = begin(each, try_one, [partial(posed, *seen, *one) for one in STARTS])
    usual, *flatter = each(try_one, [lambda: motion, *(partial(shallower, motion, depth) for depth in DEPTHS)])
    others = [one for one in (*factors.result(), *flatter) if one]
    if usual is None:
        return start, 0.0
    best = min(others, key=lambda one: one.unlikeliness, default=usual)
    best = best if best.unlikeliness < usual.unlikeliness - LIKELIER else usual
    alike = [one for one in (usual, *others) if one.unlikeliness < best.unlikeliness + LIKELIER]
    otherwise = max(apart(best.known.shapes, one.known.shapes, mirrored=not camera.perspective) for one in alike)
    return start if best is usual else best, otherwise


def each(
    make: Callable[[Callable[[], RigidMotion]], Start | None], means: list[Callable[[], RigidMotion]]
) -> list[Start | None]:
    """What is made of each."""
    return [make(mean) for mean in means]


def tried(
    rigid: Map, settings: Settings, W: Array, visible: Mask, sound: Mask, mean: Callable[[], RigidMotion]
) -> Start | None:
    """What few modes and points tell about another mean shape; None if no Gaussian holds the points."""
    with suppress(np.linalg.LinAlgError):
        found = replace(rigid, rest=replace(rigid.rest, motion=mean()), model=None)
        model, first = begun(found, settings, W, visible, sound, USUAL_MODES, FEW_POINTS)
        return Start(model, learned(model, W, visible, first, first.log_s, ROUNDS, FEW_POINTS), first.log_s)
    return None


def shallower(motion: RigidMotion, factor: float) -> RigidMotion:
    """A shape so many times as deep along the usual line of sight, and turned further for that (bas-relief).

    What swells while it turns may look like either.
    """
    usual = nearest_rotation(motion.R.sum(axis=0))
    rows = (motion.R @ usual.T)[:, :2]
    rows[:, :, 2] /= factor
    return replace(motion, shape=np.diag([1.0, 1.0, factor]) @ usual @ motion.shape, R=rotations_from_rows(rows))


def modelled(found: Map, settings: Settings, W: Array, sound: Mask, modes: int = MOST_MODES) -> Model:
    """Modes by what moves together, for keyframes in their order; arguments as for `begun`."""
    motion = found.rest.motion
    apart = own_motion((seen_by(found.camera, motion) - W) / motion.s[:, None, None], sound)
    return replace(found, modes=modes, model=None).modelled(settings, own_motion=apart)


def begun(
    found: Map, settings: Settings, W: Array, visible: Mask, sound: Mask, modes: int = MOST_MODES, points: int = POINTS
) -> tuple[Model, State]:
    """Modes by what moves together, and pose and Λ' of each keyframe by itself.

    Args:
        found: the map of keyframes, in their order.
        settings: how to reconstruct.
        W: (K, 2, p) px; finite.
        visible: (K, p).
        sound: (K, p) of that, what is not grossly wrong.
        modes: how many.
        points: at most, by which poses are found.
    """
    motion, model = found.rest.motion, modelled(found, settings, W, sound, modes)
    some = well_spread(model.B[:3], visible, points)
    few = model.of_points(some)
    energy = build_energy(few, "general", settings.priors)
    window = SlidingWindow(few, energy, settings.window, replace(motion, shape=motion.shape[:, some]))
    states = []
    for one, seen in zip(W[:, :, some], visible[:, some], strict=True):
        window.advance(one, seen)
        assert window.state is not None
        states.append(window.state[-1:])
    return model, join(states)
