"""Where learning a solid's deformations begins: its modes, and a pose and Λ' of each keyframe."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.bundle import Bundle, seen_by
from reconstruction.mapping.solid.deforming.deformations import Learned
from reconstruction.mapping.solid.deforming.learning import POINTS, ROUNDS, learned
from reconstruction.mapping.solid.deforming.low_rank import posed
from reconstruction.mapping.solid.deforming.own_motion import own_motion
from reconstruction.mapping.solid.placing import well_spread
from reconstruction.settings import MOST_MODES, USUAL_MODES, Settings
from reconstruction.state import State, join
from reconstruction.window.energy import build_energy
from reconstruction.window.window import SlidingWindow

STARTS = (2, 10.0), (4, 10.0), (2, 1e3), (3, 1e3)  # so many shapes; points so many deviations off may be wrong, or swing
FEW_POINTS = 100  # by which it is seen whether they have
LIKELIER = 0.12  # of minus the log likelihood of an image point: less is for errors of tracks


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


def likeliest(start: Start, rigid: Map, settings: Settings, W: Array, visible: Mask, sound: Mask) -> Start:
    """The same, or one about another mean shape (`low_rank`), if that makes much likelier what keyframes show.

    All are compared by few modes and few points; the rigid map and other arguments as for `begun`.
    """
    motion, camera = rigid.rest.motion, rigid.camera
    bundle, off = Bundle(motion, 1 / camera.focal_px), W - camera.center_px[:, None]

    def begun_by(motion: RigidMotion) -> Start:
        found = replace(rigid, rest=replace(rigid.rest, motion=motion), model=None)
        model, first = begun(found, settings, W, visible, sound, USUAL_MODES, FEW_POINTS)
        return Start(model, learned(model, W, visible, first, first.log_s, ROUNDS, FEW_POINTS), first.log_s)

    with suppress(np.linalg.LinAlgError):  # where no Gaussian holds the points
        limit = begun_by(motion).unlikeliness - LIKELIER
        for one in STARTS:
            with suppress(np.linalg.LinAlgError):
                other = begun_by(posed(off, visible, bundle, *one))
                if other.unlikeliness < limit:
                    limit, start = other.unlikeliness, other
    return start


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
