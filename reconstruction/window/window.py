"""Bundle adjustment over a sliding window of frames, robust to outliers (paper §5)."""

from dataclasses import replace

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.estimate import ShapeEstimate, Switch
from reconstruction.state import State, extrapolated, join, with_newest
from reconstruction.window import ambiguity, statistics
from reconstruction.window.ambiguity import CLEARLY_BETTER, OTHER_BENDS, first_pose, off_the_saddle, other_bend
from reconstruction.window.energy import Energy
from reconstruction.window.marginal import Previous, carried, information_of
from reconstruction.window.priors import FIRMEST, FITTING
from reconstruction.window.refinement import Refinement
from reconstruction.window.robust import FEWEST_POINTS, robust_weights, start_weights
from reconstruction.window.smoothness import deformation_change
from reconstruction.window.solver import Solution, Solver, minimise, one_step
from reconstruction.window.statistics import Statistics, image_statistics, stack
from reconstruction.window.terms import data_normal
from reconstruction.window.uncertainty.uncertainty import Uncertainty

ADJUST = Solver()
STEP = Solver(iterations=1)  # for all frames, once the newest is adjusted, and for that with other weights
SHOW = Solver(iterations=4, tolerance=1e-2)  # for what is only shown: no later frame starts from it
RELIABLE = 0.5  # weight above which a point counts for the pose of the first frame
REWEIGHTINGS = 5  # most rounds of robust weights: one for clean points, more while gross outliers still pull
REWEIGHTED = 0.005  # share of the weights that must change for another round
LEAST_SURPRISE = 1e-5  # energy of a new frame, a misfit of 0.3 % of the size, up to which other bends are not tried
SURPRISE = 2.0  # times the usual energy of a new frame, above which they are
BENT_GAIN = 0.95  # another bend must cost less than this share of the window's energy
EXPECTED = 0.3  # weight of the pull to a shape that is expected
RENEWED = 0.1  # weight of the newest frame in running means


class SlidingWindow:
    """Bundle adjustment over the last frames; one public verb.

    Args:
        model: the rest shape and its modes.
        energy: what is minimised.
        length: frames 𝒲 in the window.
        motion: how the rest shape is seen in the first frame.
        refine: whether frames that leave the window refine the rest shape.
        guide: an energy to be minimised before `energy` where that alone might end on the wrong branch (`build_guide`).
            The window is then adjusted by it; only the newest frame, before it is shown, by `energy`.
        uncertainty: gives estimates standard deviations.

    Attributes:
        state: the window's frames; None before the first.
        frames: so many so far.
    """

    def __init__(
        self,
        model: Model,
        energy: Energy,
        length: int,
        motion: RigidMotion,
        *,
        refine: bool = False,
        guide: Energy | None = None,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        self.model = model
        self.state: State | None = None
        self._energy, self._shown = guide or energy, energy if guide else None
        self._length, self._motion, self._uncertainty = length, motion, uncertainty
        self._pull = self._energy.rest
        self._misfit: float | None = None  # mean squared, running mean
        self._usual: float | None = None  # energy of a new frame, running mean
        self._before: Previous | None = None  # the frame that has left the window
        self._lost: State | None = None  # the last frame before a restart
        self._data: list[Statistics] = []
        self.frames, self._refine = 0, refine
        self._rest = Refinement(len(model.basis.eigenvalues))
        self._switch: Switch | None = None  # of the newest frame

    def advance(self, W: Array, visible: Mask, expected: State | None = None) -> ShapeEstimate:
        """Add the next frame's points (2, p) px and adjust the window; returns the newest frame's shape.

        Args:
            W: (2, p) px; anything where not visible.
            visible: (p,).
            expected: its pose and Λ' by other knowledge (n = 1): where it starts, and what it is pulled to.
        """
        if expected is not None:
            return self._near(W, visible, expected)
        self.frames += 1
        self._switch = None
        if self.state is not None and len(self.state) > len(self._data):  # begun by the model before, which saw that frame
            if self._data:
                self.state = self.state[-len(self._data) :]
            else:
                self.restart()
        weights = start_weights(self._last_shape(), W, visible, self.model.radius_px)
        self._data.append(image_statistics(self.model, W, weights))
        window = self._started(W, weights)
        found = self._newest(window)
        if self._lost is not None:  # the better of that and the last frame's shape
            found = min(found, self._newest(self._lost), key=lambda one: float(one.value[0]))
            self._lost = None
        surprised = self._surprising(found)
        if surprised:
            found = self._otherwise(window, found, W, weights)
        window, found = self._reweighted(with_newest(window, found.state), found, W, visible, weights)
        newest = float(found.value[-1])
        # After a surprise the new level is the usual one: it is not asked about twice.
        self._usual = newest if surprised else running_mean(self._usual, newest)
        self.state = window
        if self._energy.adaptive:
            self._weigh_rest(self.state[-1:])
        return replace(self._estimate(W, visible, self._as_shown(self.state)), switch=self._switch)

    def _near(self, W: Array, visible: Mask, expected: State) -> ShapeEstimate:
        """The next frame by itself, near to what is expected."""
        self.frames += 1
        weights = robust_weights(self.model.residuals(W, expected) / self.model.radius_px, visible)
        data = image_statistics(self.model, W, weights)
        energy = Energy(rest=EXPECTED, centre=expected.Lambda[0], rows=self._energy.rows, tied=False)
        found = one_step(energy, data, expected)
        # The frame before stays for the prediction.
        self.state = found if self.state is None else join([self.state[-1:], found])
        self._data, self._before, self._lost = [*self._data[-1:], data], None, None
        return self._estimate(W, visible, found)

    def restart(self) -> None:
        """The surface was lost: the next frame is tied to nothing, and starts from the rest or from the last shape."""
        if self.state is not None:
            self._lost = self.state[-1:]
        self.state, self._before, self._data = None, None, []

    def predict(self, ahead: int = 1) -> Array | None:
        """Image (p, 2) px so many frames on at constant velocity; None before the first frame."""
        if self.state is None:
            return None
        last = self.state[-1:]
        if len(self.state) > 1:
            before = self.state[-2:-1]
            for _ in range(ahead):
                before, last = last, extrapolated(before, last)
        return self.model.projection(last).T

    def _last_shape(self) -> Array:
        """The last frame's shape (3, p), px, its first two rows as seen by the camera."""
        if self.state is None:
            last = self._motion.s[0] * self._motion.R[0] @ self._motion.shape
        else:
            last = self.model.radius_px * (self.state.matrices()[-1] @ self.model.B)
        return last / (1 + last[2] / self.model.camera.focal_px)

    def _started(self, W: Array, weights: Array) -> State:
        """The window with the new frame as it starts, of at most its length."""
        if self.state is None:
            few = (weights > RELIABLE).sum() < FEWEST_POINTS
            return self._lost if self._lost is not None and few else self._alone(W, weights)
        window = join([self.state, off_the_saddle(self.state[-1:], self.model)])
        return self._without_oldest(window) if len(window) > self._length else window

    def _alone(self, W: Array, weights: Array) -> State:
        """A frame as its own image has it, nothing deformed."""
        return first_pose(self.model, self._motion, W, weights > RELIABLE, self._rest.rest)

    def _without_oldest(self, window: State) -> State:
        """The window without its oldest frame, which becomes the one before it and refines the rest shape."""
        oldest, data = window[:1], data_normal(self._data.pop(0), window[:1])
        information = None
        if self._energy.adaptive:
            information = information_of(data.diagonal[0], self._energy.rows)
            if self._before is not None and self._before.information is not None:
                information = information + self._before.information
            information = carried(information, deformation_change(self._energy, oldest, window[1:2])[2][0])
        self._before = Previous(oldest, information)
        if self._refine:
            self._rest.add(data)
            self._energy = self._energy.about(self._rest.rest)
            self._shown = self._shown and self._shown.about(self._rest.rest)
        return window[1:]

    def _surprising(self, found: Solution) -> bool:
        """Whether the newest frame costs so much that the window may be on the wrong branch."""
        if self._usual is None or (self._energy.edges is None and not self._energy.free):
            return False
        return bool(found.value[-1] > max(SURPRISE * self._usual, LEAST_SURPRISE))

    def _otherwise(self, window: State, found: Solution, W: Array, weights: Array) -> Solution:
        """The best of a solution and others: a sheet starts undeformed or bent back, a solid as its image alone says."""
        best = found
        if self._energy.free and (weights > RELIABLE).sum() >= FEWEST_POINTS:
            best = self._better(best, window, self._alone(W, weights), CLEARLY_BETTER)
        for factors in OTHER_BENDS if self._energy.edges is not None else ():
            best = self._better(best, window, other_bend(best.state, factors, self._rest.rest))
        self._switch = ambiguity.switch_between(found, best)
        return best

    def _better(self, found: Solution, window: State, start: State, gain: float = BENT_GAIN) -> Solution:
        """That of the newest frame or what another start of it leads to, if this costs clearly less."""
        other = self._newest(with_newest(window, start))
        return other if other.value[0] < gain * found.value[0] else found

    def _reweighted(
        self, window: State, found: Solution, W: Array, visible: Mask, weights: Array
    ) -> tuple[State, Solution]:
        """The window adjusted with robust weights by its newest frame's residuals, again until they hardly change."""
        for k in range(REWEIGHTINGS):
            left = self.model.residuals(W, window) / self.model.radius_px
            before, weights = weights, robust_weights(left, visible)
            changed = np.abs(weights - before).sum() >= REWEIGHTED * len(weights)
            if changed:
                self._data[-1] += image_statistics(self.model, W, weights - before)  # of few points
            if k == 0 and len(window) > 1:  # all frames, once
                found = minimise(self._energy, stack(self._data), window, self._before, STEP)
                window = found.state
            elif changed:
                found = self._newest(window, solver=STEP)
                window = with_newest(window, found.state)
            else:
                break
        return window, found

    def _weigh_rest(self, newest: State) -> None:
        """Pull to rest by what the model leaves over: the noise, and what its modes cannot follow."""
        data = self._data[-1]
        misfit = float(statistics.value(data, newest.matrices())[0]) / max(data.seen, 1e-9)
        self._misfit = running_mean(self._misfit, misfit)
        self._energy = replace(self._energy, rest=np.clip(self._misfit / FITTING**2, 1.0, FIRMEST) * self._pull)

    def _as_shown(self, state: State) -> State:
        """The frames with the newest adjusted by the energy that follows the guide, if there is one."""
        return with_newest(state, self._newest(state, self._shown, SHOW).state) if self._shown else state

    def _estimate(self, W: Array, visible: Mask, state: State) -> ShapeEstimate:
        """The newest frame of a state in units of shape and image."""
        estimate = self.model.estimate(self.frames - 1, W, visible, state)
        if self._uncertainty is None:
            return estimate
        energy = self._shown or self._energy
        return replace(estimate, sigma=self._uncertainty.sigma(energy, self._data[-1], state[-1:], W, visible))

    def _newest(self, window: State, energy: Energy | None = None, solver: Solver = ADJUST) -> Solution:
        """The newest frame of a window adjusted alone, which takes a fraction of the whole window's time."""
        before = Previous(window[-2:-1]) if len(window) > 1 else self._before
        return minimise(energy or self._energy, self._data[-1], window[-1:], before, solver)


def running_mean(mean: float | None, value: float) -> float:
    """The mean of the values so far, older ones counting less; None before the first."""
    return value if mean is None else (1 - RENEWED) * mean + RENEWED * value
