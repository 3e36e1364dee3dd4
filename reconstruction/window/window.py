"""Bundle adjustment over a sliding window of frames, robust to outliers (paper §5)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.camera import (
    CONJUGATE,
    quaternion_exp,
    quaternion_from_rotation,
    quaternion_product,
    rotation_from_quaternion,
)
from reconstruction.mapping.outliers import LEAST_SIGMA, off_the_common_motion
from reconstruction.mapping.rigid import RigidMotion, pose_energy
from reconstruction.mapping.sheet import tilt_axes
from reconstruction.state import State, join
from reconstruction.window import statistics
from reconstruction.window.ambiguity import Switch, switch_between
from reconstruction.window.energy import Energy, change_of, data_normal
from reconstruction.window.marginal import Past, carried, known
from reconstruction.window.model import Model, ShapeEstimate
from reconstruction.window.priors import FIRMEST, FITTING
from reconstruction.window.refinement import Refinement
from reconstruction.window.solver import Solution, Solver, minimise
from reconstruction.window.statistics import Statistics, stack

Array = NDArray[np.float64]
Visibility = NDArray[np.bool_]

ADJUSTING = Solver()
SETTLING = Solver(tolerance=1e-2)  # of what is only shown: nothing builds on it
LEADING = Solver(iterations=3)  # to where that starts from
FEWEST_POINTS = 4
ROBUST_SIGMAS = 8.0  # deviations from the model beyond which a point counts less
GROSS_SIGMAS = 7.0  # deviations from the common motion beyond which a point is no sound start
TRUSTED = 0.5  # weight above which a point says where the first frame is
REWEIGHTINGS = 5  # most rounds of robust weights: one for clean points, more while gross outliers still pull
REWEIGHTED = 0.005  # share of the weights that must change for another round
CALM = 1e-5  # energy of a new frame (a misfit of 0.3 % of the size) that is no surprise whatever was usual
SURPRISE = 2.0  # times the usual energy of a new frame, above which other bends are tried
BENT_GAIN = 0.95  # of the window's energy, below which another bend is believed
TILT_GAIN = 0.7  # of the first frame's energy, below which another tilt is believed
FIRST_TILT = 0.3  # radians by which the first frame is tilted to look for a better pose
FACING = 0.05  # radians within which a shape's main plane faces the camera
LEAN = 0.1  # radians by which it is leant then
OTHER_BENDS = (np.zeros((3, 1)), np.array([[1.0], [1.0], [-1.0]]))  # factors on the rows of Λ: undeformed, bent back


class SlidingWindow:
    """Bundle adjustment over the last frames; one public verb.

    Args:
        model: the rest shape and its modes.
        energy: what is minimised.
        length: frames 𝒲 in the window.
        motion: how the rest shape is seen in the first frame.
        refine: whether frames that leave the window refine the rest shape.
        guides: energies that lead to it where it would lose the branch it is on: the first stands in for it in the window,
            and the newest frame, before it is shown, is adjusted by each of the others in turn.

    Attributes:
        state: the window's frames; None before the first.
        spent: energy of all frames so far, each when it was the newest.
    """

    def __init__(
        self,
        model: Model,
        energy: Energy,
        length: int,
        motion: RigidMotion,
        *,
        refine: bool = False,
        guides: Sequence[Energy] = (),
    ) -> None:
        self.model = model
        self.state: State | None = None
        self.spent = 0.0
        self._energy, *self._shown = *guides, energy
        self._length, self._motion = length, motion
        self._pull = self._energy.rest
        self._misfit = np.nan  # mean squared, of frames so far
        self._before: Past | None = None  # the frame that has left the window
        self._lost: State | None = None  # the last frame before everything started anew
        self._data: list[Statistics] = []
        self._usual = np.inf  # energy of a new frame, running mean
        self._frame = -1
        self._rest = Refinement(len(model.basis.eigenvalues))
        self._refine = refine
        self._switch: Switch | None = None  # of the newest frame

    def advance(self, W: Array, visible: Visibility) -> ShapeEstimate:
        """Take the next frame's points (2, p) px and adjust the window; returns the newest frame's shape."""
        self._frame += 1
        self._switch = None
        weights = self._first_weights(W, visible)
        self._data.append(self.model.statistics(W, weights))
        if self.state is None:
            window = self._first_state(W, weights > TRUSTED)
        else:
            window = join([self.state, self._leant(self.state[-1:])])
        if len(window) > self._length:
            window = self._without_oldest(window)
        found = self._adjust(with_newest(window, self._newest(self._energy, window)))
        if self._lost is not None:
            found, self._lost = min(found, self._adjust(self._lost), key=lambda one: float(one.value.sum())), None
        surprised = self._energy.edges is not None and found.value[-1] > max(SURPRISE * self._usual, CALM)
        if surprised:
            found = self._bent_otherwise(found)
        for _ in range(REWEIGHTINGS):
            before, weights = weights, robust_weights(self.model.residuals(W, found.state), visible)
            if np.abs(weights - before).sum() < REWEIGHTED * len(weights):
                break
            self._data[-1] = self.model.statistics(W, weights)
            alone = self._newest(self._energy, found.state)
            found = replace(found, state=with_newest(found.state, alone), value=np.append(found.value[:-1], alone.value))
        newest = float(found.value[-1])
        self.spent += newest
        if np.isinf(self._usual) or surprised:
            self._usual = newest  # one surprise is not asked twice
        else:
            self._usual = 0.9 * self._usual + 0.1 * newest
        self.state = found.state
        if np.isfinite(self._energy.jump):
            self._weigh_rest(self.state[-1:])
        return replace(self.model.estimate(self._frame, W, visible, self._settled()), switch=self._switch)

    def restart(self) -> None:
        """The surface was lost: the next frame is tied to nothing, and starts from the rest or from the last shape."""
        if self.state is not None:
            self._lost = self.state[-1:]
        self.state, self._before, self._data = None, None, []

    def predict(self) -> Array | None:
        """Image (p, 2) px of the next frame at constant velocity; None before the first frame."""
        if self.state is None:
            return None
        last = self.state[-1:]
        return self.model.projection(extrapolated(self.state[-2:-1], last) if len(self.state) > 1 else last).T

    def _without_oldest(self, window: State) -> State:
        """The window without its oldest frame: held by what that leaves behind, about the rest shape that it refines."""
        oldest, seen = window[:1], data_normal(self._data.pop(0), window[:1])
        hold = None
        if np.isfinite(self._energy.jump):
            information = known(seen.diagonal[0], self._energy.rows)
            if self._before is not None and self._before.hold is not None:
                information = information + self._before.hold
            hold = carried(information, change_of(self._energy, oldest, window[1:2])[2][0])
        self._before = Past(oldest, hold)
        if self._refine:
            self._rest.take(seen)
            self._energy = self._energy.about(self._rest.rest)
            self._shown = [energy.about(self._rest.rest) for energy in self._shown]
        return window[1:]

    def _weigh_rest(self, newest: State) -> None:
        """Pull to rest by what the model leaves over: the noise, and what its modes cannot follow."""
        data = self._data[-1]
        misfit = float(statistics.value(data, newest.matrices())[0]) / max(data.seen, 1e-9)
        self._misfit = misfit if np.isnan(self._misfit) else 0.9 * self._misfit + 0.1 * misfit
        firmer = np.clip(self._misfit / FITTING**2, 1.0, FIRMEST)
        self._energy = replace(self._energy, rest=firmer * self._pull)

    def _adjust(self, start: State) -> Solution:
        return minimise(self._energy, stack(self._data), start, self._before, ADJUSTING)

    def _settled(self) -> State:
        """The frames with the newest as it is shown: where the guides lead to, and the energy from there."""
        assert self.state is not None
        settled = self.state
        for energy in self._shown:
            solver = SETTLING if energy is self._shown[-1] else LEADING
            settled = with_newest(settled, self._newest(energy, settled, solver))
        return settled

    def _first_weights(self, W: Array, visible: Visibility) -> Array:
        """Visibility (p,) without the points whose motion since the last shape is out of all proportion."""
        if visible.sum() < FEWEST_POINTS:
            return visible.astype(np.float64)
        if self.state is None:
            last = self._motion.R[0] @ self._motion.shape
        else:
            last = self.model.radius * (self.state.matrices()[-1] @ self.model.B)
        last = last / (1 + last[2] / self.model.camera.focal_px)
        off = off_the_common_motion(last, W, visible, GROSS_SIGMAS)
        return robust_weights(off, visible, GROSS_SIGMAS, LEAST_SIGMA * self.model.radius)

    def _newest(self, energy: Energy, window: State, solver: Solver = ADJUSTING) -> Solution:
        """The newest frame adjusted alone, which takes a fraction of the whole window's time."""
        before = Past(window[-2:-1]) if len(window) > 1 else self._before
        return minimise(energy, self._data[-1], window[-1:], before, solver)

    def _leant(self, last: State) -> State:
        """Where a new frame starts: as the last one, but never facing an orthographic camera exactly.

        There the image's derivative by tilt and by bending is zero: a saddle that the solver never leaves. (At constant
        velocity a tilt would overshoot into the mirrored branch.)
        """
        facing = abs(float(rotation_from_quaternion(last.q)[0, 2, 2]))
        if self.model.camera.perspective or facing < np.cos(FACING):
            return last
        return replace(last, q=quaternion_product(quaternion_exp(np.array([[LEAN, 0.0, 0.0]])), last.q))

    def _bent_otherwise(self, found: Solution) -> Solution:
        """The best of a solution and those with the newest frame undeformed or bent back at the start.

        Edge lengths make the energy of Λ non-convex: a sheet bent one way or the other looks alike.
        """
        best, rest = found, self._rest.rest
        for factors in OTHER_BENDS:
            Lambda = best.state.Lambda.copy()
            Lambda[-1] = rest + factors * (Lambda[-1] - rest)
            other = self._adjust(replace(best.state, Lambda=Lambda))
            if other.value.sum() < BENT_GAIN * best.value.sum():
                best = other
        self._switch = switch_between(found, best)
        return best

    def _first_state(self, W: Array, visible: Visibility) -> State:
        """Pose of the first frame with nothing deformed: that of the bootstrap, or a clearly better tilt."""
        shape, model = self._motion.shape, self.model
        data = model.rigid_statistics(W, visible.astype(np.float64))
        seen = W[:, visible] - model.camera.center_px[:, None]
        extent = np.var((self._motion.R[0] @ shape)[:2, visible], axis=1).sum()
        log_s = np.log(np.sqrt(np.var(seen, axis=1).sum() / extent))
        q = quaternion_from_rotation(self._motion.R[0] @ model.basis.Phi)
        start = State(q[None], seen.mean(axis=1)[None] / model.radius, np.array([log_s]), np.zeros((1, 3, 0)))
        energy = pose_energy(model.camera)
        found = best = minimise(energy, data, start, None, ADJUSTING)
        for tilt in FIRST_TILT * tilt_axes():
            tilted = replace(start, q=quaternion_product(quaternion_exp(tilt), q)[None])
            other = minimise(energy, data, tilted, None, ADJUSTING)
            if other.value[0] < TILT_GAIN * best.value[0]:
                best = other
        self._switch = switch_between(found, best)
        return replace(best.state, Lambda=self._rest.rest[None].copy())


def with_newest(window: State, newest: Solution) -> State:
    """The window with another newest frame."""
    return join([window[:-1], newest.state])


def extrapolated(earlier: State, last: State) -> State:
    """One frame further at constant velocity."""
    turned = quaternion_product(last.q, quaternion_product(earlier.q * CONJUGATE, last.q))
    return State(turned, 2 * last.t - earlier.t, 2 * last.log_s - earlier.log_s, 2 * last.Lambda - earlier.Lambda)


def robust_weights(residuals: Array, visible: Visibility, sigmas: float = ROBUST_SIGMAS, least: float = 0.0) -> Array:
    """Weights (p,) that let points so many deviations of the residuals (2, p) px away count little (Geman-McClure).

    Few deviations would also silence bends that the modes cannot follow.
    """
    if visible.sum() < FEWEST_POINTS:
        return visible.astype(np.float64)
    distance = np.linalg.norm(np.where(visible, residuals, 0.0), axis=0)
    sigma = max(np.median(distance[visible]) / 1.1774, least)  # median of a Rayleigh distribution
    excess = np.maximum(distance / max(sigmas * sigma, 1e-9), 1.0)
    return np.where(visible, excess**-4.0, 0.0)
