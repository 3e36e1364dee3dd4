"""Whole runs of the estimator, as the frame loop makes them."""

import numpy as np

from reconstruction.basis import rest_shape
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.evaluation import e3d
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from tests.reconstruction.world import PERSPECTIVE, flat, relief, seen, turns

FRAMES, POINTS = 26, 70
SETTINGS = Settings(modes=8)


def swelling_hill(camera: Camera = PERSPECTIVE) -> tuple[np.ndarray, np.ndarray]:
    """A solid that turns rigidly for 15 frames, then one side of it swells and sinks."""
    rest = relief(np.random.default_rng(0), POINTS)
    x, y, _ = rest
    bump = 60 * np.exp(-((x - 30) ** 2 + (y + 20) ** 2) / 60**2) * np.array([[0.3], [0.3], [1.0]])
    amounts = np.concatenate([np.zeros(15), np.sin(np.linspace(0, np.pi, FRAMES - 15))])
    shapes = rest + amounts[:, None, None] * (bump - bump.mean(axis=1, keepdims=True))
    return seen(shapes, turns(FRAMES), camera)


def still_sheet(noise_px: float = 0.05) -> np.ndarray:
    rng = np.random.default_rng(1)
    shapes = np.broadcast_to(flat(rng, POINTS), (70, 3, POINTS))
    W, _ = seen(shapes, np.broadcast_to(np.eye(3), (70, 3, 3)), PERSPECTIVE)
    return W + rng.normal(0, noise_px, W.shape)


def reconstruct(
    W: np.ndarray,
    camera: Camera = PERSPECTIVE,
    settings: Settings = SETTINGS,
    truth: np.ndarray | None = None,
    visible: np.ndarray | None = None,
) -> tuple[Reconstruction, list[ShapeEstimate]]:
    """All frames, as the frame loop gives them; with `truth`, its first shape is the rest shape."""
    given = None if truth is None else rest_shape.given(truth[0], "truth", "first true shape")
    visible = np.ones((len(W), W.shape[2]), bool) if visible is None else visible
    reconstruction = Reconstruction(camera, settings, given)
    estimates: list[ShapeEstimate] = []
    for w, h in zip(W, visible, strict=True):
        estimates += reconstruction.update(np.where(h, w, np.nan), h)
    return reconstruction, estimates + reconstruction.finish()


def shapes_of(estimates: list[ShapeEstimate]) -> np.ndarray:
    return np.stack([e.shape for e in estimates])


def error(estimates: list[ShapeEstimate], truth: np.ndarray) -> float:
    return float(e3d(shapes_of(estimates), truth).mean())


def static_error(reconstruction: Reconstruction, truth: np.ndarray) -> float:
    assert reconstruction.rest is not None
    return float(e3d(np.broadcast_to(reconstruction.rest.motion.shape, truth.shape), truth).mean())
