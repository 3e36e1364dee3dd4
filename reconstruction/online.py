"""The on-line estimator: one observation in, the shapes it settles out (paper §5)."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reconstruction import ReconstructionError, rest_shape
from reconstruction.camera import Camera
from reconstruction.energy import Energy
from reconstruction.mesh import Mesh, mesh_from_faces, triangulate
from reconstruction.model import Model, ShapeEstimate
from reconstruction.modes import Metric, modal_basis, principal_axes
from reconstruction.rest_shape import RestShape
from reconstruction.rigid import ORTHOGRAPHIC_SCALE, PERSPECTIVE_SCALE
from reconstruction.window import SlidingWindow

Array = NDArray[np.float64]
Visibility = NDArray[np.bool_]

Deformation = Literal["auto", "bending", "stretching", "general", "inextensible"]
ROWS: dict[str, tuple[int, ...]] = {
    "bending": (2,),
    "stretching": (0, 1),
    "general": (0, 1, 2),
    "inextensible": (0, 1, 2),
}
# λ_0 and λ_γ: the more a constraint says, the less is left for the pull to rest and to the frame before.
PULLS: dict[str, tuple[float, float]] = {
    "bending": (1e-2, 1e-3),
    "stretching": (2e-2, 3e-2),
    "general": (2e-2, 3e-2),
    "inextensible": (1e-3, 1e-3),
}
INEXTENSIBILITY = 3.0  # κ
BOOTSTRAP_SCHEDULE = (10, 15, 20, 30, 45, 60)  # frames after which a rigid shape is looked for; the last decides


class Phase(Enum):
    """What the estimator is doing."""

    BOOTSTRAP = "bootstrap"
    TRACKING = "tracking"
    LOST = "lost"


@dataclass(frozen=True)
class Settings:
    """How to reconstruct.

    Attributes:
        rest_shape: auto, rigid or plane; `given` overrides it.
        bootstrap_frames: frames the rest shape comes from; None decides from the evidence.
        modes: r.
        metric: dissimilarity the modes come from.
        deformation: constraint on Λ (§3.4).
        window: frames 𝒲 adjusted together.
        energy: anchored (tied to the past, pulled to rest) or the paper's §5 as printed.
    """

    rest_shape: Literal["auto", "rigid", "plane"] = "auto"
    bootstrap_frames: int | None = None
    modes: int = 20
    metric: Metric = "euclidean"
    deformation: Deformation = "auto"
    window: int = 5
    energy: Literal["anchored", "paper"] = "anchored"


class Reconstruction:
    """From observations to shapes, frame by frame: bootstrap first, then a sliding window.

    Args:
        camera: the camera; the paper's energy needs an orthographic one.
        settings: how to reconstruct.
        given: a rest shape (3, p) from elsewhere.
        mesh: its mesh, if it has one.

    Attributes:
        rest: the rest shape, once there is one.
        window: the sliding window, once there is a rest shape.
        bootstrap_frames: frames the bootstrap took.
        deformation: the constraint in force; auto until the rest shape decides.
    """

    def __init__(
        self, camera: Camera, settings: Settings, given: RestShape | None = None, mesh: Mesh | None = None
    ) -> None:
        if settings.energy == "paper" and camera.perspective:
            raise ReconstructionError("--energy paper is orthographic: use it with --camera orthographic")
        self.camera, self.settings = camera, settings
        self.rest = given
        self._mesh = mesh
        self.window: SlidingWindow | None = None
        self.bootstrap_frames = 0
        self.deformation = settings.deformation
        self._waiting: list[tuple[Array, Visibility]] = []

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

    def predict(self) -> Array | None:
        """Where the next frame will see the points, (p, 2) px at constant velocity; None while bootstrapping."""
        return None if self.window is None else self.window.predict()

    def update(self, W: Array, visible: Visibility) -> list[ShapeEstimate]:
        """Take one frame's points (2, p) px with visibility (p,); returns the shapes now known, oldest first.

        Raises:
            ReconstructionError: no rest shape can be had from the frames so far.
        """
        if self.window is not None:
            return [self.window.advance(W, visible)]
        if self.settings.modes >= W.shape[1]:
            raise ReconstructionError(f"--modes {self.settings.modes} does not fit {W.shape[1]} points: choose fewer")
        self._waiting.append((W, visible))
        n, wanted = len(self._waiting), self.settings.bootstrap_frames
        if self.rest is not None:
            return self._start(self.rest)
        if wanted is None:
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

    def _decide(self, last: bool) -> list[ShapeEstimate]:
        W = np.stack([w for w, _ in self._waiting])
        visible = np.stack([v for _, v in self._waiting])
        kind = self.settings.rest_shape
        if kind == "plane":
            return self._start(rest_shape.plane(W, visible, self.camera))
        if kind == "rigid" and self.settings.bootstrap_frames is not None:
            return self._start(rest_shape.rigid(W, visible, self.camera))
        doubt = "there are too few frames for a rigid shape"
        if len(W) >= BOOTSTRAP_SCHEDULE[0]:
            doubt = rest_shape.weigh(W, visible).doubt
            if not doubt:
                return self._start(rest_shape.rigid(W, visible, self.camera))
        if not last:
            return []
        if kind == "rigid":
            raise ReconstructionError(
                f"cannot recover a rest shape: {doubt}; give one with --rest-shape plane or --rest-shape mesh.obj"
            )
        flat = rest_shape.plane(W, visible, self.camera)
        return self._start(replace(flat, note=f"{flat.note} (no rigid shape: {doubt})"))

    def _start(self, rest: RestShape) -> list[ShapeEstimate]:
        self.rest, self.bootstrap_frames = rest, len(self._waiting)
        if self.deformation == "auto":
            self.deformation = "inextensible" if rest.flat else "general"
        model = build_model(rest, self.camera, self.settings, self._mesh)
        energy = build_energy(model, self.deformation, paper=self.settings.energy == "paper")
        self.window = SlidingWindow(model, energy, self.settings.window, rest.motion)
        waiting, self._waiting = self._waiting, []
        return [self.window.advance(W, visible) for W, visible in waiting]


def build_model(rest: RestShape, camera: Camera, settings: Settings, mesh: Mesh | None) -> Model:
    """Mesh and modes of a rest shape.

    Raises:
        ReconstructionError: more modes than the points carry.
    """
    shape = rest.motion.shape
    if mesh is None:
        mesh = triangulate((principal_axes(shape).T @ shape)[:2].T)
        x, y = (rest.motion.R[0] @ shape)[:2]
        a, b, c = mesh.faces.T
        area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
        if area.sum() > 0:  # y points down: outward normals face the camera when the image winds the other way
            mesh = mesh_from_faces(mesh.faces[:, ::-1])
    return Model(modal_basis(shape, mesh, settings.modes, settings.metric), mesh, camera)


def build_energy(model: Model, deformation: Deformation, *, paper: bool) -> Energy:
    """The energy of a constraint on the deformation (paper §5, §3.4); `paper` as printed there."""
    rows = ROWS[deformation]
    if paper:
        return Energy(rows=rows, rest=0.0, deformation=1e-3, free_scale=False, tied=False)
    scale = PERSPECTIVE_SCALE if model.camera.perspective else ORTHOGRAPHIC_SCALE
    # A mode's eigenvalue says how much of the shape's extent it carries: weak modes are pulled to rest harder.
    stiffness = model.basis.eigenvalues**-0.5
    stiffness /= np.exp(np.log(stiffness).mean())
    rest, smooth = PULLS[deformation]
    energy = Energy(scale=scale, deformation=smooth, rest=rest * stiffness, rows=rows)
    if deformation == "inextensible":
        return replace(energy, inextensibility=INEXTENSIBILITY, edges=model.coarse_edges())
    return energy
