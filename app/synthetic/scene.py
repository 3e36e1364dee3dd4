"""A thing of a kind before a camera."""

from dataclasses import dataclass

import numpy as np

from app.arrays import Array
from app.synthetic.catalog import HELD_SEEDS, KINDS, Kind
from app.synthetic.path import Path
from app.synthetic.places import Shape, grid

FRAMES = 120


@dataclass(frozen=True)
class Scene:
    """A thing that moves; lengths are in widths of it, x right, y down, z forward.

    Attributes:
        name: kind and seed.
        kind: what it is.
        seed: of everything random about it.
        frames: length of the video.
        held_back: whether it is not for tuning.
    """

    name: str
    kind: Kind
    seed: int
    frames: int
    held_back: bool
    shape: Shape
    path: Path

    def points(self, places: Array, frame: int) -> Array:
        """Where places (n, 2) of the thing are in a frame: (n, 3) in camera axes."""
        time = frame / max(self.frames - 1, 1)
        shape = self.shape(places, time)
        R, t = self.path.pose(time)
        return np.asarray((shape - self.shape(grid(9, 7), time).mean(axis=0)) @ R.T + t)

    def faces_camera(self, places: Array, frame: int, step: float = 1e-4) -> Array:
        """Cosine (n,) of the angle at which places are looked at: below 0 they show their back, 1 is frontal."""
        at, right, down = (self.points(places + np.array(by), frame) for by in ((0, 0), (step, 0), (0, step)))
        normal = np.cross(right - at, down - at)
        return np.asarray((normal * at).sum(axis=1) / np.linalg.norm(normal, axis=1) / np.linalg.norm(at, axis=1))


def scene(kind: str, seed: int, frames: int = FRAMES) -> Scene:
    """A thing of a kind in `KINDS`; the same seed makes the same."""
    rng = np.random.default_rng([seed, *kind.encode()])
    one = KINDS[kind]
    held_back = one.held_back or seed >= HELD_SEEDS
    return Scene(f"{kind} {seed}", one, seed, frames, held_back, one.shape(rng), one.path(rng))
