"""Surfaces that move in a known way, and how cameras see them."""

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from reconstruction.basis.mesh import triangulate
from reconstruction.basis.model import Model
from reconstruction.basis.modes import modal_basis
from reconstruction.camera import Camera, nearest_rotation, quaternion_exp, rotation_from_quaternion
from reconstruction.settings import Metric
from reconstruction.state import State
from reconstruction.window.statistics import Statistics, image_statistics, stack

Array = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1).map(np.random.default_rng)
PERSPECTIVE = Camera(500.0, np.array([320.0, 240.0]))
ORTHOGRAPHIC = Camera(center_px=np.array([320.0, 240.0]))
CAMERAS = st.sampled_from([PERSPECTIVE, ORTHOGRAPHIC])


def spread(rng: np.random.Generator, p: int, width: float = 200.0, height: float = 150.0) -> Array:
    """(2, p) points on a jittered grid, px, centred: scattered, but none on top of another."""
    columns = int(np.ceil(np.sqrt(p)))
    place = np.stack(np.divmod(np.arange(p), columns)) / (columns - 1) - 0.5
    place = place + rng.uniform(-0.25, 0.25, (2, p)) / columns
    points = place[::-1] * np.array([[width], [height]])
    return points - points.mean(axis=1, keepdims=True)


def relief(rng: np.random.Generator, p: int, height: float = 40.0) -> Array:
    """(3, p) a smooth hilly surface, px, centred."""
    x, y = spread(rng, p)
    a, b = rng.uniform(0, 2 * np.pi, 2)
    shape = np.stack([x, y, height * (np.cos(x / 45 + a) + np.sin(y / 38 + b))])
    return shape - shape.mean(axis=1, keepdims=True)


def flat(rng: np.random.Generator, p: int) -> Array:
    """(3, p) a flat sheet, px, centred."""
    return np.concatenate([spread(rng, p), np.zeros((1, p))])


def rolled(sheet: Array, curvature: float) -> Array:
    """The flat sheet (3, p) rolled around a vertical axis without stretching; curvature in 1/px."""
    x, y, _ = sheet
    if abs(curvature) < 1e-12:
        return sheet
    bent = np.stack([np.sin(curvature * x) / curvature, y, (np.cos(curvature * x) - 1) / curvature])
    return bent - bent.mean(axis=1, keepdims=True)


def turn(degrees: tuple[float, float, float]) -> Array:
    """Rotation (3, 3) by a rotation vector in degrees."""
    return rotation_from_quaternion(quaternion_exp(np.deg2rad(np.array(degrees))))


def turns(count: int, degrees: float = 25.0) -> Array:
    """(count, 3, 3) rotations on a smooth path: the viewing direction describes a curve, not just an arc."""
    phase = np.linspace(0, 1.6 * np.pi, count)
    path = np.stack([np.sin(phase), 0.7 * np.sin(2 * phase + 0.4) - 0.7 * np.sin(0.4), 0.2 * phase], axis=1)
    return rotation_from_quaternion(quaternion_exp(np.deg2rad(degrees) * path))


def seen(shapes: Array, R: Array, camera: Camera, depth: float = 1.0) -> tuple[Array, Array]:
    """Images (F, 2, p) px of shapes (F, 3, p) turned by R, and the shapes (F, 3, p) in camera axes.

    `depth` is the distance in focal lengths: at 1 the first shape is seen in its own pixels.
    """
    placed = R @ shapes
    if camera.perspective:
        placed = placed + np.array([[0.0], [0.0], [camera.focal_px * depth]])
    return camera.project(placed), placed


def views(shape: Array, R: Array, camera: Camera) -> tuple[Array, NDArray[np.bool_]]:
    """Images (F, 2, p) px of a rigid shape (3, p) in poses R (F, 3, 3), and the visibility (F, p) of all its points."""
    W, _ = seen(np.broadcast_to(shape, (len(R), *shape.shape)), R, camera)
    return W, np.ones((len(R), shape.shape[1]), bool)


def bending_sheet(camera: Camera = PERSPECTIVE, points: int = 70, frames: int = 26) -> tuple[Array, Array]:
    """Images (F, 2, p) px of a sheet that is rolled up and flattened while it turns, and its shapes in camera axes."""
    sheet = flat(np.random.default_rng(0), points)
    tilt = turn((12, -8, 0))
    shapes = np.stack([rolled(sheet, 0.009 * np.sin(np.pi * f / (frames - 1))) for f in range(frames)])
    R = np.stack([turn((6 * np.sin(f / 5), 20 * f / frames, 3 * f / frames)) for f in range(frames)])
    return seen(shapes, R @ tilt, camera)


def random_rotation(rng: np.random.Generator) -> Array:
    return nearest_rotation(rng.normal(size=(3, 3)))


def unit_quaternions(rng: np.random.Generator, n: int) -> Array:
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def random_state(rng: np.random.Generator, n: int, r: int) -> State:
    """n frames whose poses and shapes are near one another, as in a video."""
    q = unit_quaternions(rng, 1) + 0.1 * rng.normal(size=(n, 4))
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    return State(q, rng.normal(size=(n, 2)), 0.2 * rng.normal(size=n), 0.3 * rng.normal(size=(n, 3, r)))


def model_of(shape: Array, camera: Camera, modes: int, metric: Metric = "euclidean") -> Model:
    """The model of a rest shape (3, p)."""
    mesh = triangulate(shape[:2].T)
    return Model(modal_basis(shape, mesh, modes, metric), mesh, camera)


def statistics_of(model: Model, W: Array, weights: Array) -> Statistics:
    """Sums of several frames (n, 2, p) px."""
    return stack([image_statistics(model, w, h) for w, h in zip(W, weights, strict=True)])


def shape_error(estimate: Array, truth: Array) -> float:
    """Relative difference of shapes (3, p) after the best rotation, scale and depth sign."""
    from reconstruction.evaluation import e3d

    return float(e3d(estimate[None], truth[None])[0])
