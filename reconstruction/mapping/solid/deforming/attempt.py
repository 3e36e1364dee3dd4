"""An attempt at learning a solid's deformations: a mean shape with its modes, and what keyframes tell with them."""

from dataclasses import dataclass, replace

import numpy as np

from reconstruction.arrays import Array, Indices, Mask
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import quaternion_from_rotation, rotation_from_quaternion
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.bundle import Bundle, seen_by
from reconstruction.mapping.solid.deforming.deformations import Learned, going_with_turn
from reconstruction.mapping.solid.deforming.learning import POINTS, ROUNDS, learned
from reconstruction.mapping.solid.deforming.own_motion import own_motion
from reconstruction.mapping.solid.placing import well_spread, with_others
from reconstruction.settings import MOST_MODES, Settings
from reconstruction.state import State, join
from reconstruction.window.energy import build_energy
from reconstruction.window.window import SlidingWindow

SETTLED = 8  # rounds of learning that remain where all points follow what some have told


@dataclass(frozen=True)
class Shown:
    """Keyframes in the order of time, and how to reconstruct them.

    Attributes:
        rigid: the map of them, nothing deformed.
        settings: how to reconstruct.
        W: (K, 2, p) px; finite.
        visible: (K, p).
        sound: (K, p) of that, what is not grossly wrong.
        frames: (K,) their numbers.
    """

    rigid: Map
    settings: Settings
    W: Array
    visible: Mask
    sound: Mask
    frames: Indices

    def of_points(self, some: Indices) -> "Shown":
        """The same of some points only."""
        rest, visible = self.rigid.rest, self.visible[:, some]
        rest = replace(rest, motion=replace(rest.motion, shape=rest.motion.shape[:, some]))
        rigid = replace(self.rigid, rest=rest, seen=visible, model=None)
        return replace(self, rigid=rigid, W=self.W[:, :, some], visible=visible, sound=self.sound[:, some])

    def learned(self, model: Model, state: State, log_s: Array, rounds: int = ROUNDS, points: int = POINTS) -> Learned:
        """What they tell; arguments as for `learning.learned`, which says what is raised."""
        return learned(model, self.W, self.visible, state, log_s, rounds, points)


@dataclass(frozen=True)
class Attempt:
    """What has been learned so far.

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

    def about(self, found: Map) -> Map:
        """The map about its rest shape, with the poses that keyframes have then."""
        model, Phi, state = self.model, self.model.basis.Phi, self.known.state
        shape = model.radius * Phi @ self.known.B[:3]
        R, s = rotation_from_quaternion(state.q) @ Phi.T, model.scale * np.exp(state.log_s)
        motion = RigidMotion(shape, R, s, model.radius_px * state.t)
        rest = replace(found.rest, motion=motion)
        model = Model(replace(model.basis, rest=shape), model.mesh, model.camera, float(motion.s[0]))
        deformations = replace(self.known.deformations, turning=going_with_turn(state))
        return replace(found, rest=rest, modes=len(model.basis.eigenvalues), model=model, deformations=deformations)

    def carried(self, again: Model, points: Indices | slice = slice(None)) -> State:
        """Pose and Λ' of keyframes in the modes of another model, about the same rest shape: of `points` of it."""
        model, state = self.model, self.known.state
        turn = again.basis.Phi.T @ model.basis.Phi
        deformed = turn @ state.Lambda @ self.known.B[3:-1] * (model.radius / again.radius)
        return State(
            quaternion_from_rotation(rotation_from_quaternion(state.q) @ turn.T),
            state.t * (model.radius_px / again.radius_px),
            state.log_s + np.log(model.scale / again.scale),
            deformed @ np.linalg.pinv(again.B[3:-1, points]),
        )

    def scales(self, again: Model) -> Array:
        """To which scales are held (K,) by another model: as before, else each attempt would let them go further."""
        return np.asarray(self.log_s + np.log(self.model.scale / again.scale))


def gone_on(attempt: Attempt, shown: Shown, modes: int = MOST_MODES, rounds: int = ROUNDS, points: int = POINTS) -> Attempt:
    """Where it leads to, by so many modes made anew: poses learned so far tell better what moves together.

    Arguments as for `learned`, which says what is raised.
    """
    again = modelled(attempt.about(shown.rigid), shown, modes)
    log_s = attempt.scales(again)
    return Attempt(again, shown.learned(again, attempt.carried(again), log_s, rounds, points), log_s)


def among_all(attempt: Attempt, some: Indices, shown: Shown) -> Attempt:
    """What has been learned by some of the points, for all of them: they are placed where keyframes posed so show them.

    Arguments as for `gone_on`.
    """
    rigid = shown.rigid
    seen = shown.W - rigid.camera.center_px[:, None], shown.sound.astype(np.float64)
    known = Bundle(attempt.about(rigid).rest.motion, 1 / rigid.camera.focal_px)
    placed = with_others(*seen, known, some)
    found = replace(rigid, rest=replace(rigid.rest, motion=placed.motion))
    again = modelled(found, shown, len(attempt.model.basis.eigenvalues))
    log_s = attempt.scales(again)
    return Attempt(again, shown.learned(again, attempt.carried(again, some), log_s, SETTLED), log_s)


def modelled(found: Map, shown: Shown, modes: int = MOST_MODES) -> Model:
    """Modes by what moves together."""
    motion = found.rest.motion
    apart = own_motion((seen_by(found.camera, motion) - shown.W) / motion.s[:, None, None], shown.sound)
    return replace(found, modes=modes, model=None).modelled(shown.settings, own_motion=apart)


def begun(found: Map, shown: Shown, modes: int = MOST_MODES, points: int = POINTS) -> tuple[Model, State]:
    """Modes by what moves together, and pose and Λ' of the keyframes, one after the other as of a video.

    Args:
        found: the map of keyframes, in their order.
        shown: these.
        modes: how many.
        points: at most, by which poses are found.
    """
    motion, model = found.rest.motion, modelled(found, shown, modes)
    some = well_spread(model.B[:3], shown.visible, points)
    few = model.of_points(some)
    energy = build_energy(few, "general", shown.settings.priors)
    window = SlidingWindow(few, energy, shown.settings.window, replace(motion, shape=motion.shape[:, some]))
    states = []
    for one, seen in zip(shown.W[:, :, some], shown.visible[:, some], strict=True):
        window.advance(one, seen)
        assert window.state is not None
        states.append(window.state[-1:])
    return model, join(states)
