"""The on-line estimator: one observation in, the shapes it settles out (paper §5)."""

from dataclasses import replace
from enum import Enum

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Mask
from reconstruction.basis import constraints, distances
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.model import Model, build_model
from reconstruction.basis.rest_shape import RestShape, scaled_to
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.mapping import focal, rest_shape
from reconstruction.mapping.evidence import TURN_DEGREES, weigh
from reconstruction.mapping.factorization import view_turn_degrees
from reconstruction.mapping.keyframes import Keyframes
from reconstruction.mapping.map import Map, map_of, ratio_of_sizes
from reconstruction.mapping.outliers import without_outliers
from reconstruction.settings import Deformation, Metric, Settings
from reconstruction.window import priors
from reconstruction.window.energy import build_energy, build_guides
from reconstruction.window.priors import Weights
from reconstruction.window.window import SlidingWindow

BOOTSTRAP_SCHEDULE = (10, 15, 20, 30, 45, 60)  # frames after which a rigid shape is looked for; the last decides


class Phase(Enum):
    """What the estimator is doing."""

    BOOTSTRAP = "bootstrap"
    TRACKING = "tracking"
    LOST = "lost"


class Reconstruction:
    """From observations to shapes, frame by frame: bootstrap first, then a sliding window.

    Args:
        camera: the camera, its focal length perhaps only assumed; the paper's energy needs an orthographic one.
        settings: how to reconstruct.
        given: a rest shape (3, p) from elsewhere.
        mesh: its mesh, if it has one.

    Attributes:
        map: what the keyframes said the object is; None while the first frames' word stands.
        rest: the rest shape, once there is one.
        window: the sliding window, once there is a rest shape.
        bootstrap_frames: frames the bootstrap took.
        metric: the dissimilarity in force; None until the rest shape decides.
        deformation: the constraint in force; auto until the rest shape decides.
        focal_note: what the first frames say about the focal length, in words; empty if they were not asked.
    """

    def __init__(
        self, camera: Camera, settings: Settings, given: RestShape | None = None, mesh: Mesh | None = None
    ) -> None:
        if settings.energy == "paper" and camera.perspective:
            raise ReconstructionError("energy paper needs an orthographic camera", "energy")
        self.camera, self.settings = camera, settings
        self.rest = given
        self.map: Map | None = None
        maps = given is None and settings.rest_shape == "auto" and settings.energy != "paper"
        self._keyframes = Keyframes() if maps else None
        self._frame = -1
        self._mesh = mesh
        self.window: SlidingWindow | None = None
        self.bootstrap_frames = 0
        self.metric: Metric | None = None
        self.deformation: Deformation = settings.deformation
        self.focal_note = ""
        self._waiting: list[tuple[Array, Mask]] = []

    @property
    def phase(self) -> Phase:
        """Bootstrapping until there is a rest shape, tracking afterwards."""
        return Phase.BOOTSTRAP if self.window is None else Phase.TRACKING

    @property
    def model(self) -> Model:
        """The rest shape with its modes; there once the bootstrap is over."""
        if self.window is None:
            raise ReconstructionError("there is no rest shape yet: the bootstrap is not over")
        return self.window.model

    @property
    def focal_words(self) -> dict[str, float | str | None]:
        """The focal length in force, None for an orthographic camera, and how it was found if it was looked for."""
        note = {"focal_note": self.focal_note} if self.focal_note else {}
        return {"focal_px": self.camera.focal_px if self.camera.perspective else None, **note}

    @property
    def weights(self) -> Weights:
        """Weights of all priors, by name; empty until the rest shape decides on the deformation."""
        if self.deformation == "auto":
            return {}
        paper = self.settings.energy == "paper"
        return priors.weights(self.settings.priors, self.deformation, perspective=self.camera.perspective, paper=paper)

    def predict(self) -> Array | None:
        """Where the next frame will see the points, (p, 2) px at constant velocity; None while bootstrapping."""
        return None if self.window is None else self.window.predict()

    def update(self, W: Array, visible: Mask) -> list[ShapeEstimate]:
        """Take one frame's points (2, p) px with visibility (p,); returns the shapes now known, oldest first.

        Raises:
            ReconstructionError: no rest shape can be had from the frames so far.
        """
        self._frame += 1
        if self._keyframes is not None:
            self._keyframes.offer(self._frame, W, visible)
        if self.window is not None:
            if self.map is None or self.deformation != "inextensible":
                return [self.window.advance(W, visible)]
            expected = self.map.expected(self.window.model, W, visible, self.window.state)
            return [self.window.advance(W, visible, expected)]
        if self.settings.modes >= W.shape[1]:
            problem = f"modes {self.settings.modes} does not fit {W.shape[1]} points: choose fewer"
            raise ReconstructionError(problem, "modes")
        self._waiting.append((W, visible))
        n, wanted = len(self._waiting), self.settings.bootstrap_frames
        if self.rest is not None:
            return self._start(scaled_to(self.rest, W, visible))
        if wanted == "auto":
            if n in BOOTSTRAP_SCHEDULE:
                return self._decide(last=n == BOOTSTRAP_SCHEDULE[-1])
        elif n >= wanted:
            return self._decide(last=True)
        return []

    def restart(self) -> None:
        """The surface was lost and is seen again, somewhere else: keep the model, forget the last frames."""
        if self.window is not None:
            self.window.restart()

    def finish(self) -> list[ShapeEstimate]:
        """No more frames: settle for what the bootstrap has; returns the shapes of its frames."""
        return self._decide(last=True) if self.window is None and self._waiting else []

    def revise(self) -> bool:
        """What the object is by keyframes of all frames so far: replace the model, if they tell; whether they do.

        Then all frames are worth another pass: the next one to `update` is the first again.
        """
        if self._keyframes is None or self.window is None:
            return False
        W, visible, frames = self._keyframes.spread()
        self._keyframes = None
        found = map_of(W, visible, self.camera, estimate_focal=self.settings.estimate_focal)
        if found is None:
            return False
        found = found.scaled(ratio_of_sizes(self.window.model.basis.rest, found.rest.motion.shape))
        rest = replace(found.rest, motion=found.rest.motion.in_order(np.argsort(frames)))
        if self.settings.estimate_focal and found.camera.perspective:
            self.focal_note = f"focal length {found.camera.focal_px:.0f} px, from {len(W)} keyframes"
        self.map, self.camera, self.deformation = found, found.camera, self.settings.deformation
        self._build(rest)
        return True

    def _decide(self, last: bool) -> list[ShapeEstimate]:
        W = np.stack([w for w, _ in self._waiting])
        visible = without_outliers(W, np.stack([v for _, v in self._waiting]))
        kind = self.settings.rest_shape
        if kind == "plane":
            return self._recover("plane", W, visible)
        if kind == "rigid" and self.settings.bootstrap_frames != "auto":
            return self._recover("rigid", W, visible)
        doubt = "there are too few frames for a rigid shape"
        if len(W) >= BOOTSTRAP_SCHEDULE[0]:
            doubt = weigh(W, visible).doubt
            if not doubt:
                rest = rest_shape.rigid(W, visible, self.camera)
                turn = view_turn_degrees(rest.motion.R)
                if kind == "rigid" or turn >= TURN_DEGREES:
                    return self._recover("rigid", W, visible, rest=rest)
                # Things that move by themselves pass for parallax until perspective is reckoned with.
                doubt = f"the object turned {turn:.1f}° in {len(W)} frames, about {TURN_DEGREES:.0f}° are needed"
        if not last:
            return []
        if kind == "rigid":
            raise ReconstructionError(f"cannot recover a rest shape: {doubt}", "rest_shape")
        return self._recover("plane", W, visible, f" (no rigid shape: {doubt})")

    def _recover(
        self, kind: str, W: Array, visible: Mask, remark: str = "", rest: RestShape | None = None
    ) -> list[ShapeEstimate]:
        """The rest shape of the first frames (F, 2, p), if it is not there yet, by the focal length that they hold."""
        recovery = rest_shape.rigid if kind == "rigid" else rest_shape.plane
        rest = rest or recovery(W, visible, self.camera)
        if self.settings.estimate_focal and self.camera.perspective:
            found = focal.estimate(W, visible, self.camera, rest, self.deformation, self.settings.priors)
            self.camera, self.focal_note = replace(self.camera, focal_px=found.focal_px), found.note
            if found.known:
                rest = recovery(W, visible, self.camera)
        return self._start(replace(rest, note=rest.note + remark))

    def _start(self, rest: RestShape) -> list[ShapeEstimate]:
        """The shapes of the frames that wait, with this rest shape."""
        self.bootstrap_frames = len(self._waiting)
        self._build(rest)
        assert self.window is not None
        waiting, self._waiting = self._waiting, []
        return [self.window.advance(W, visible) for W, visible in waiting]

    def _build(self, rest: RestShape) -> None:
        """The model and the window of a rest shape."""
        self.rest = rest
        sheet = rest.flat or rest.kind == "isometric"
        self.deformation = constraints.fitting(self.deformation, flat=sheet)
        self.metric = distances.fitting(self.settings.metric, flat=sheet)
        model = build_model(rest, self.camera, self.settings.modes, self.metric, self._mesh)
        paper = self.settings.energy == "paper"
        energy = build_energy(model, self.deformation, self.settings.priors, paper=paper)
        refine = self.settings.refine_rest and not paper and rest.kind != "isometric"
        guides = build_guides(model, self.deformation, paper=paper)
        self.window = SlidingWindow(model, energy, self.settings.window, rest.motion, refine=refine, guides=guides)
