"""A synthetic organ: an extensible dome of 3,024 points that beats while a camera moves around it (paper's Fig. 7)."""

from dataclasses import dataclass

import numpy as np

from app.arrays import Array
from tracking.tracks import Tracks

POINTS = 3024  # the paper's beating heart has as many
SIZE = np.array([640.0, 480.0])
FOCAL_PX = 700.0
DISTANCE = 900.0
HALF_WIDTH, HALF_HEIGHT, RELIEF = 210.0, 165.0, 120.0
REST_FRAMES = 15  # before it beats
FRAMES_PER_BEAT = 24
CONTRACTION, WAVE, TWIST_DEGREES = 0.14, 0.9, 6.0
NOISE_PX = 0.3


@dataclass(frozen=True)
class Organ:
    """The surface at rest, scattered evenly.

    Attributes:
        rest: (3, p), x right, y down, z away from the eye.
        height: (p,) from 0 at its base to 1 at its tip, along its longer axis.
    """

    rest: Array
    height: Array

    def beating(self, frame: float) -> Array:
        """(3, p) shape in a frame: a wave of contraction runs from tip to base, with a twist."""
        phase = 2 * np.pi * max(frame - REST_FRAMES, 0.0) / FRAMES_PER_BEAT
        squeeze = CONTRACTION * 0.5 * (1 - np.cos(phase)) * (1 + 0.5 * np.sin(phase - WAVE * 2 * np.pi * self.height))
        x, y, z = self.rest
        angle = np.deg2rad(TWIST_DEGREES) * 0.5 * (1 - np.cos(phase)) * self.height
        x, z = x * (1 - squeeze), z * (1 - squeeze)
        c, s = np.cos(angle), np.sin(angle)
        return np.stack([c * x - s * z, y * (1 - 0.4 * squeeze), s * x + c * z])


def organ(points: int = POINTS) -> Organ:
    """A dome with a groove; sunflower seeds on its base."""
    k = np.arange(points) + 0.5
    radius, angle = np.sqrt(k / points), np.pi * (3 - np.sqrt(5)) * k
    u, v = radius * np.cos(angle), radius * np.sin(angle)
    groove = 0.18 * np.exp(-(((u - 0.25 * v) / 0.16) ** 2)) * (1 - radius**2)
    z = -RELIEF * (np.sqrt(1 - 0.85 * radius**2) * (1 + 0.12 * v) - groove)
    rest = np.stack([HALF_WIDTH * u * (1 - 0.2 * v), HALF_HEIGHT * v, z])
    return Organ(rest - rest.mean(axis=1, keepdims=True), (v + 1) / 2)


def camera_turn(frame: float) -> Array:
    """R (3, 3): the camera sways about both axes."""
    yaw, pitch = np.deg2rad(22 * np.sin(frame / 7)), np.deg2rad(12 * np.sin(frame / 11))
    about_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    about_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    return np.asarray(about_x @ about_y)


def organ_tracks(frames: int, points: int = POINTS, seed: int = 0) -> Tracks:
    """The organ seen by a perspective camera with noise, and its true shapes."""
    shape, rng = organ(points), np.random.default_rng(seed)
    K = np.array([[FOCAL_PX, 0, SIZE[0] / 2], [0, FOCAL_PX, SIZE[1] / 2], [0, 0, 1]])
    S = np.stack([camera_turn(f) @ shape.beating(f) + np.array([[0.0], [0.0], [DISTANCE]]) for f in range(frames)])
    image = K @ S
    W = image[:, :2] / image[:, 2:] + rng.normal(0.0, NOISE_PX, (frames, 2, points))
    return Tracks(W, np.ones((frames, points), bool), K, S, np.arange(frames))
