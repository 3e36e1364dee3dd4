"""The on-line estimator: one observation in, the shapes it settles out (paper §5)."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis import constraints, distances
from reconstruction.basis.mesh import Mesh, ratio_of_sizes
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import RestShape, scaled_to
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.mapping.foresight import Foresight
from reconstruction.mapping.isometric.one_frame import Foreseen
from reconstruction.mapping.map import Map
from reconstruction.mapping.mapper import FEWEST_POINTS, Mapper
from reconstruction.mapping.start import at_once
from reconstruction.settings import Deformation, Metric, Settings
from reconstruction.window import priors
from reconstruction.window.energy import build_energy, build_guide
from reconstruction.window.priors import Weights
from reconstruction.window.uncertainty.uncertainty import Uncertainty
from reconstruction.window.window import SlidingWindow


class Phase(Enum):
    """What the estimator is doing."""

    BOOTSTRAP = "bootstrap"
    TRACKING = "tracking"
    LOST = "lost"


@dataclass(frozen=True)
class Waiting:
    """A frame that has no shape yet: points (2, p) px, visible (p,), and whether the surface was lost before it."""

    W: Array
    visible: Mask
    restart: bool

    @property
    def shows_enough(self) -> bool:
        """Whether it shows points enough for a pose."""
        return int(self.visible.sum()) >= FEWEST_POINTS


class Reconstruction:
    """From observations to shapes, frame by frame: a first model, then a sliding window, and better models on the way.

    Args:
        camera: the camera, its focal length perhaps only assumed; the paper's energy needs an orthographic one.
        settings: how to reconstruct.
        given: a rest shape (3, p) from elsewhere.
        mesh: its mesh, if it has one.
        mapper: what finds the models; by itself one that makes them at once.

    Attributes:
        map: what the object is, as far as is known; None before there is a model.
        camera: with the focal length in force.
        window: the sliding window, once there is a model.
        bootstrap_frames: frames that gave the first model.
        metric, deformation: dissimilarity and constraint in force; None and auto until the rest shape decides.
        revisions: how often another model replaced the one before, on the way.
    """

    def __init__(
        self,
        camera: Camera,
        settings: Settings,
        given: RestShape | None = None,
        mesh: Mesh | None = None,
        mapper: Mapper | None = None,
    ) -> None:
        if settings.energy == "paper" and camera.perspective:
            raise ReconstructionError("energy paper needs an orthographic camera", "energy")
        self.camera, self.settings = camera, settings
        self._assumed = camera  # first frames may mislead: maps find the focal length by themselves
        self.map: Map | None = None
        self._given = given
        self._mapper: Mapper | None = mapper or Mapper(settings, given=given)
        self._mesh = mesh
        self.window: SlidingWindow | None = None
        self.bootstrap_frames = 0
        self.metric: Metric | None = None
        self.deformation: Deformation = settings.deformation
        self.revisions = 0
        self._waiting: deque[Waiting] = deque()
        self._last: ShapeEstimate | None = None
        self._restart = False
        self._foresight = Foresight(at_once)
        self._foreseen: Foreseen | None = None  # in the last frame

    @property
    def phase(self) -> Phase:
        """Bootstrapping until there is a model, tracking afterwards."""
        return Phase.BOOTSTRAP if self.window is None else Phase.TRACKING

    @property
    def model(self) -> Model:
        """The rest shape with its modes; there once the bootstrap is over."""
        if self.window is None:
            raise ReconstructionError("there is no rest shape yet: the bootstrap is not over")
        return self.window.model

    @property
    def rest(self) -> RestShape | None:
        """The rest shape, once there is one."""
        return self.map.rest if self.map else self._given

    @property
    def focal_note(self) -> str:
        """How the focal length was found, in words; empty if it was not looked for."""
        return self.map.focal_note if self.map else ""

    @property
    def weights(self) -> Weights:
        """Weights of all priors, by name; empty until the rest shape decides on the deformation."""
        if self.deformation == "auto":
            return {}
        paper = self.settings.energy == "paper"
        return priors.weights(self.settings.priors, self.deformation, perspective=self.camera.perspective, paper=paper)

    @property
    def behind(self) -> bool:
        """Whether frames wait for shapes."""
        return bool(self._waiting)

    def predict(self, ahead: int = 1) -> Array | None:
        """Where so many frames on the points will be, (p, 2) px at constant velocity; None while frames wait for shapes."""
        return None if self.window is None or self.behind else self.window.predict(ahead)

    def update(self, W: Array, visible: Mask) -> list[ShapeEstimate]:
        """Take one frame's points (2, p) px with visibility (p,); returns the shapes now known, oldest first.

        Raises:
            ReconstructionError: no rest shape can be had from the frames so far.
        """
        if self.settings.modes != "auto" and self.settings.modes >= W.shape[1]:
            problem = f"modes {self.settings.modes} does not fit {W.shape[1]} points: choose fewer"
            raise ReconstructionError(problem, "modes")
        self._waiting.append(Waiting(W, visible, self._restart))
        self._restart = False
        oldest = self._waiting[0]
        found = self._mapper.add(W, visible, self._assumed, (oldest.W, oldest.visible)) if self._mapper else None
        if self._given is not None and self.map is None and self._waiting[-1].shows_enough:
            found = Map(scaled_to(self._given, W, visible), self.camera)
        if found is not None:
            self.revisions += self.window is not None
            self._adopt(found)
        return self._advance(self._mapper.at_a_time if self._mapper else len(self._waiting))

    def restart(self) -> None:
        """The surface was lost and is seen again, somewhere else: keep the model, forget the last frames."""
        self._restart = True

    def catch_up(self) -> list[ShapeEstimate]:
        """The shapes of all frames that wait, if there is a model."""
        return self._advance(len(self._waiting))

    def finish(self) -> list[ShapeEstimate]:
        """No more frames: settle for what the bootstrap has; returns the shapes of all frames that wait.

        Raises:
            ReconstructionError: no rest shape can be had from them.
        """
        if self.window is None and self._mapper:
            found = self._mapper.finish(self._assumed)
            if found is not None:
                self._adopt(found)
        return self.catch_up()

    def revise(self, frames: Iterable[tuple[Array, Mask]]) -> bool:
        """Replace the model by what the keyframes of all `frames` tell the object to be, if they do; whether they do.

        Then these, which `update` was given, are worth another pass: the next one to it is the first again.
        """
        if self._mapper and self.window and (found := self._mapper.final(self._assumed, frames)):
            self._foresight = Foresight(self._mapper.start)
            self._mapper = self._last = None
            self._adopt(found)
            return True
        return False

    def foresee(self, frames: list[tuple[Array, Mask]]) -> None:
        """Begin what can be done for the next frames, points (2, p) px with visibility (p,), before they come."""
        if self.map is not None and self.deformation == "inextensible":
            self._foresight.begin(self.map, frames)

    def _advance(self, most: int) -> list[ShapeEstimate]:
        """The shapes of at most so many of the frames that wait, oldest first."""
        if self.window is None or (self.window.state is None and not any(one.shows_enough for one in self._waiting)):
            return []
        return [self._shape_of(self._waiting.popleft()) for _ in range(min(most, len(self._waiting)))]

    def _shape_of(self, frame: Waiting) -> ShapeEstimate:
        """The shape of the next frame."""
        assert self.window is not None
        assert self.map is not None
        if frame.restart:
            self.window.restart()
        seen = frame
        if self.window.state is None and not frame.shows_enough:  # as in the first frame after it that does
            seen = next((one for one in self._waiting if one.shows_enough), frame)
        expected, foreseen = None, self._foresight.next()
        if self.deformation == "inextensible":
            if foreseen is None or seen is not frame:
                foreseen = self.map.foreseen([(seen.W, seen.visible)], self._foreseen)[0]
            expected = self.map.expected(self.window.model, foreseen, self.window.state)
        self._foreseen, self._last = foreseen or self._foreseen, self.window.advance(seen.W, seen.visible, expected)
        if seen is frame:
            return self._last
        return replace(self._last, visible=frame.visible, residual_px=np.full_like(self._last.residual_px, np.nan))

    def _adopt(self, found: Map) -> None:
        """Go on with another model, as large as the one before, and from its last shape."""
        before, last = self.window, self._last
        if before is None:
            self.bootstrap_frames = self._mapper.first_frames if self._mapper else 1
        else:
            found = found.scaled(ratio_of_sizes(before.model.basis.rest, found.rest.motion.shape))
            if last is not None and not found.camera.perspective:
                found = found.turned_like(last.shape)
        model = None if self._mesh else found.model
        model = model or found.modelled(self.settings, self._mesh)
        self.map, self.camera, self._foreseen = replace(found, model=None), found.camera, None
        self.deformation = constraints.fitting(self.settings.deformation, flat=found.is_sheet)
        self.metric = distances.fitting(self.settings.metric, flat=found.is_sheet)
        paper = self.settings.energy == "paper"
        pull = None if found.deformations is None else found.deformations.pull(model.B.shape[1])
        energy = build_energy(model, self.deformation, self.settings.priors, paper=paper, pull=pull)
        keeps_lengths = self.deformation in ("bending", "inextensible")
        by_focal = found.sheet.by_focal if found.sheet else 0.0
        refine = self.settings.refine_rest and keeps_lengths and not paper and found.sheet is None
        self.window = SlidingWindow(
            model,
            energy,
            self.settings.window,
            found.rest.motion,
            refine=refine,
            guide=build_guide(model, self.deformation, paper=paper),
            uncertainty=Uncertainty(model, by_focal) if self.settings.uncertainty else None,
        )
        if before is not None and last is not None:
            self.window.frames, self.window.state = before.frames, found.state_of(model, last.shape)
