"""Points on a thing as a tracker would give them, with noise, gaps and gross errors, and the truth."""

from dataclasses import dataclass

import numpy as np

from app.demo.camera import K, project
from app.synthetic.places import scattered
from app.synthetic.scene import Scene
from reconstruction.evaluation import with_missing, with_outliers
from tracking.tracks import Tracks

POINTS = 260
GRAZING = 0.1  # cosine under which nothing is tracked


@dataclass(frozen=True)
class Damage:
    """What is done to tracks.

    Attributes:
        noise_px: standard deviation of a coordinate.
        missing: share of the entries hidden.
        outliers: share of them put anywhere among the others.
    """

    noise_px: float = 0.2
    missing: float = 0.0
    outliers: float = 0.0


USUAL, SEVERE = Damage(), Damage(0.5, 0.4, 0.1)


def tracks(scene: Scene, damage: Damage = USUAL, points: int = POINTS) -> Tracks:
    """Scattered points of a thing in all frames; hidden where they show their back to the camera."""
    rng = np.random.default_rng([scene.seed, points])
    places = scattered(rng, points)
    S = np.stack([scene.points(places, frame) for frame in range(scene.frames)])
    front = np.stack([scene.faces_camera(places, frame) for frame in range(scene.frames)]) > GRAZING
    W = np.stack([project(s) for s in S]).transpose(0, 2, 1)
    return damaged(Tracks(W, front, K, S.transpose(0, 2, 1), np.arange(scene.frames)), damage, rng)


def damaged(given: Tracks, damage: Damage, rng: np.random.Generator) -> Tracks:
    """Tracks (F, 2, P) with noise, gaps and gross errors."""
    W = given.W + damage.noise_px * rng.standard_normal(given.W.shape)
    visible = with_missing(given.visible, damage.missing, rng)
    W = with_outliers(W, given.visible, damage.outliers, rng) if damage.outliers else W
    return Tracks(np.where(visible[:, None], W, np.nan), visible, given.K, given.S_gt, given.gt_frames)
