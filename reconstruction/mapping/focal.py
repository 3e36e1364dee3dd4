"""The focal length from the data: with the wrong one, the first frames cost more energy."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from reconstruction.arrays import Array, Mask
from reconstruction.basis import constraints
from reconstruction.basis.model import Model, build_model
from reconstruction.basis.modes import principal_axes
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.mapping import rest_shape
from reconstruction.mapping.evidence import judging_points
from reconstruction.mapping.sheet import sheet
from reconstruction.settings import Deformation
from reconstruction.state import join
from reconstruction.window.energy import Energy, build_energy
from reconstruction.window.robust import robust_weights
from reconstruction.window.solver import Solver, minimise
from reconstruction.window.statistics import image_statistics, stack
from reconstruction.window.window import SlidingWindow

FEWEST = 10  # frames; fewer show too little turn
FRAMES = 12  # of them, spread, are enough to compare by
MODES = 20
STEP = 2.0**0.5  # between the focal lengths looked at first
SHORTEST, LONGEST = -4, 6  # most steps from the focal length assumed so far
NEARBY = 1.3  # so much longer or shorter, a sheet is tilted alike
SIDE = STEP  # a focal length so much longer or shorter than the best ...
RISE = 1.1  # ... must cost so many times more for the data to hold it
PRECISION = 0.02  # of the focal length
EVALUATIONS = 5  # most, between two steps
WINDOW = 3  # frames, for the first solution


@dataclass(frozen=True)
class FocalEstimate:
    """What the first frames say about the focal length.

    Attributes:
        focal_px: the focal length to go on with.
        known: whether the frames hold it; otherwise it is the one to start with.
        note: how that was found, in words.
    """

    focal_px: float
    known: bool
    note: str


def estimate(
    W: Array,
    visible: Mask,
    camera: Camera,
    rest: RestShape,
    deformation: Deformation,
    priors: Mapping[str, float] | None = None,
) -> FocalEstimate:
    """The focal length that explains observations (F, 2, p) px with visibility (F, p) best.

    Args:
        W: (F, 2, p) px.
        visible: (F, p).
        camera: with the focal length assumed so far.
        rest: the rest shape under that focal length, of which the pose in the first frame is believed.
        deformation: the constraint on Λ.
        priors: weights by name that are not the defaults.
    """
    if len(W) < FEWEST:
        return FocalEstimate(camera.focal_px, False, assumed(camera.focal_px, f"{len(W)} frames are too few to tell"))
    points = judging_points(W, visible)
    frames = np.unique(np.linspace(0, len(W) - 1, FRAMES).astype(int))
    motion = replace(rest.motion, shape=rest.motion.shape[:, points])
    W, visible, rest = W[frames][:, :, points], visible[frames][:, points], replace(rest, motion=motion)
    trials = Trials(W, visible, camera, rest, deformation, priors)
    return search(trials.cost, camera.focal_px)


class Trials:
    """The same frames under one focal length after another, each starting from the solution of the nearest.

    Args:
        W: (F, 2, p) px, few frames and points.
        visible: (F, p).
        camera: as in `estimate`.
        rest: as in `estimate`.
        deformation: the constraint on Λ.
        priors: as in `estimate`.
    """

    def __init__(
        self,
        W: Array,
        visible: Mask,
        camera: Camera,
        rest: RestShape,
        deformation: Deformation,
        priors: Mapping[str, float] | None,
    ) -> None:
        self._W, self._visible, self._rest, self._camera, self._priors = W, visible, rest, camera, priors
        self._deformation = constraints.fitting(deformation, flat=rest.flat)
        self._axes = {camera.focal_px: principal_axes(rest.motion.shape)}
        model, energy = self._problem(camera.focal_px)
        window = SlidingWindow(model, energy, WINDOW, rest.motion)
        states, weights = [], []
        for w, v in zip(W, visible, strict=True):
            window.advance(w, v)
            assert window.state is not None
            states.append(window.state[-1:])
            weights.append(robust_weights(model.residuals(w, window.state) / model.radius_px, v))
        self._weights, self._solved = weights, {camera.focal_px: join(states)}

    def cost(self, focal_px: float) -> float:
        """Least energy of all frames together under a focal length, mean over frames."""
        model, energy = self._problem(focal_px)
        data = stack([image_statistics(model, w, weights) for w, weights in zip(self._W, self._weights, strict=True)])
        nearest = min(self._solved, key=lambda other: abs(np.log(other / focal_px)))
        found = minimise(energy, data, self._solved[nearest], None, Solver())
        self._solved[focal_px] = found.state
        return float(found.value.mean())

    def _problem(self, focal_px: float) -> tuple[Model, Energy]:
        camera = replace(self._camera, focal_px=focal_px)
        rest = self._tilted(camera) if self._rest.kind == "plane" else self._rest
        model = build_model(rest, camera, min(MODES, self._W.shape[2] - 1))
        return model, build_energy(model, self._deformation, self._priors)

    @cached_property
    def _first_image(self) -> Array:
        return rest_shape.first_image(self._W, self._visible)

    def _tilted(self, camera: Camera) -> RestShape:
        """The flat rest shape, whose tilt depends on the focal length: looked for unless that of one nearby will do."""
        near = [axes for focal_px, axes in self._axes.items() if abs(np.log(camera.focal_px / focal_px)) < np.log(NEARBY)]
        if near:
            return replace(self._rest, motion=sheet(self._first_image, near[-1], camera).in_first_frame())
        rest = rest_shape.plane(self._W, self._visible, camera)
        self._axes[camera.focal_px] = principal_axes(rest.motion.shape)
        return rest


def search(cost: Callable[[float], float], start_px: float) -> FocalEstimate:
    """The focal length of least energy, downhill from `start_px`, if the energy clearly rises on both sides.

    Of one that is longer than is looked at, only so much is known: what it sees is as good as orthographic.

    Args:
        cost: energy of the first frames under a focal length in pixels.
        start_px: the focal length assumed so far, which stays where the data do not hold it.
    """
    costs = {step: cost(start_px * STEP**step) for step in (0, -1, 1)}
    while True:
        best = min(costs, key=lambda step: costs[step])
        beside = [step for step in (best - 1, best + 1) if step not in costs and SHORTEST <= step <= LONGEST]
        if not beside:
            break
        costs |= {step: cost(start_px * STEP**step) for step in beside}
    if best == LONGEST and costs[0] > RISE * costs[best]:
        focal_px = start_px * STEP**LONGEST
        return FocalEstimate(focal_px, True, f"focal length {focal_px:.0f} px or more, from the first frames")
    if SHORTEST < best < LONGEST:
        found = minimize_scalar(
            lambda log_px: cost(np.exp(log_px)),
            bounds=np.log(start_px) + np.log(STEP) * np.array([best - 1, best + 1]),
            method="bounded",
            options={"xatol": PRECISION, "maxiter": EVALUATIONS},
        )
        focal_px = float(np.exp(found.x))
        if min(cost(focal_px / SIDE), cost(focal_px * SIDE)) > RISE * found.fun:
            return FocalEstimate(focal_px, True, f"focal length {focal_px:.0f} px, from the first frames")
    return FocalEstimate(start_px, False, assumed(start_px, "the first frames do not hold it"))


def assumed(focal_px: float, why: str) -> str:
    """The words for a focal length that was not found."""
    return f"focal length {focal_px:.0f} px assumed: {why}; give it if you know better"
