"""Synthetic inputs of the benchmarks: surfaces of any size, and the window of a surface that moves before a camera."""

from dataclasses import dataclass

import numpy as np

from app.arrays import Array
from reconstruction.basis.constraints import ROWS
from reconstruction.basis.mesh import Mesh, triangulate
from reconstruction.basis.model import Model
from reconstruction.basis.modes import modal_basis
from reconstruction.camera import Camera, quaternion_exp, quaternion_product
from reconstruction.state import State, join
from reconstruction.window.energy import Energy
from reconstruction.window.solver import Solver, minimise
from reconstruction.window.statistics import Statistics, frame_statistics, stack

WIDTH_PX, HEIGHT_PX, RELIEF_PX = 400.0, 300.0, 60.0
FOCAL_PX = 640.0
NOISE_PX = 0.3
WINDOW = 5
MODES = 30  # the most; problems with fewer take the first
CONVERGED = Solver(iterations=100, tolerance=1e-7)  # how well the frames before the newest are known


def surface(p: int, seed: int = 0) -> Array:
    """(3, p) a hilly surface in px, centred, its points scattered but none on top of another."""
    rng = np.random.default_rng(seed)
    columns = int(np.ceil(np.sqrt(p)))
    place = np.stack(np.divmod(np.arange(p), columns)) / (columns - 1) - 0.5
    x, y = (place + rng.uniform(-0.3, 0.3, (2, p)) / columns)[::-1] * np.array([[WIDTH_PX], [HEIGHT_PX]])
    shape = np.stack([x, y, RELIEF_PX * np.cos(x / 90) * np.sin(y / 70 + 1)])
    return np.asarray(shape - shape.mean(axis=1, keepdims=True))


def surface_with_mesh(p: int) -> tuple[Array, Mesh]:
    """A surface and its Delaunay mesh."""
    rest = surface(p)
    return rest, triangulate(rest[:2].T)


def full_model(p: int) -> Model:
    """A surface with all its modes, seen by a perspective camera."""
    rest, mesh = surface_with_mesh(p)
    return Model(modal_basis(rest, mesh, MODES), mesh, Camera(FOCAL_PX))


@dataclass(frozen=True)
class WindowStep:
    """One new frame for a window that is solved: what the solver and its rivals start from.

    Attributes:
        energy: what is minimised.
        B: (4 + r, p) basis, units of the rest shape.
        focal: focal length in the same units.
        W: (n, 2, p) what the frames show, the newest last, in the same units.
        earlier: sums of all frames but the newest.
        start: the window as found so far, the newest frame like the one before.
        before: the frame that has left the window.
    """

    energy: Energy
    B: Array
    focal: float
    W: Array
    earlier: Statistics
    start: State
    before: State

    @property
    def points(self) -> int:
        """P."""
        return int(self.B.shape[1])

    @property
    def modes(self) -> int:
        """R."""
        return len(self.B) - 4

    @property
    def weights(self) -> Array:
        """(p,) everything is seen."""
        return np.ones(self.points)


def window_step(model: Model, r: int, deformation: str) -> WindowStep:
    """The step of a window over a surface that turns and deforms, r modes of the model free."""
    rng = np.random.default_rng(r)
    energy = Energy(rows=ROWS[deformation])
    B = np.concatenate([model.B[: 3 + r], model.B[-1:]])
    W = images(B, true_motion(WINDOW + 2, r, energy.rows), model.focal)
    W += NOISE_PX / model.radius_px * rng.normal(size=W.shape)
    data = [summed(B, w, model.focal) for w in W]
    first = State(true_motion(1, r, ()).q, np.zeros((1, 2)), np.zeros(1), np.zeros((1, 3, r)))
    state = minimise(energy, stack(data[:-1]), join([first] * (WINDOW + 1)), None, CONVERGED).state
    start = join([state[2:], state[-1:]])
    return WindowStep(energy, B, model.focal, W[2:], stack(data[2:-1]), start, state[1:2])


def summed(B: Array, W: Array, focal: float) -> Statistics:
    """One frame's sums, all points seen."""
    return frame_statistics(B, W, np.ones(B.shape[1]), focal)


def true_motion(n: int, r: int, rows: tuple[int, ...]) -> State:
    """N frames of a surface that turns, moves and deforms within the given rows of Λ."""
    time = np.arange(n)[:, None]
    tilt = quaternion_exp(np.array([[0.3, 0.2, 0.0]]))
    q = quaternion_product(tilt, quaternion_exp(0.04 * time * np.array([[0.3, 1.0, 0.2]])))
    Lambda = np.zeros((n, 3, r))
    sway = np.sin(0.25 * time + np.arange(r)) / (1 + np.arange(r))
    Lambda[:, rows] = 0.1 * sway[:, None]
    return State(q, 0.02 * time * np.array([[1.0, 0.5]]), np.asarray(0.01 * time[:, 0], np.float64), Lambda)


def images(B: Array, state: State, focal: float) -> Array:
    """(n, 2, p) what a camera sees of a state."""
    seen = state.matrices() @ B
    return np.asarray(seen[:, :2] / (1 + seen[:, 2:] / focal))
