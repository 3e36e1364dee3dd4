"""A camera that is turned: pictures and truth turn with it, exactly."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from app.arrays import Array
from app.footage.clip import Clip

Turn = Callable[[Clip, int], Array]  # how the camera's axes are turned in a frame: (3, 3)


def steady(_: Clip, __: int) -> Array:
    """Not at all."""
    return np.eye(3)


def rolled(degrees: float, first: int, frames: int) -> Turn:
    """Turned about its axis by so much, evenly within so many frames from a first one on."""

    def turn(_: Clip, frame: int) -> Array:
        return about(2, degrees * float(np.clip((frame - first) / frames, 0, 1)))

    return turn


def panned(share: float, first: int, frames: int) -> Turn:
    """Turned aside until such a share of the surface is out of the picture, and back, within so many frames."""

    def turn(clip: Clip, frame: int) -> Array:
        f, cx = clip.K[0, 0], clip.K[0, 2]
        x = clip.surface(first + frames // 2)[:, 0]
        middle, farthest = x.mean(), x.mean() - (x.min() + share * np.ptp(x))
        most = np.rad2deg(np.arctan((middle - cx) / f) - np.arctan((farthest - cx) / f))
        return about(1, -most * float(np.sin(np.pi * np.clip((frame - first) / frames, 0, 1)) ** 2))

    return turn


def about(axis: int, degrees: float) -> Array:
    """A turn about an axis of the camera."""
    return np.asarray(Rotation.from_euler("xyz"[axis], degrees, degrees=True).as_matrix())


def homography(K: Array, R: Array, stretch: tuple[float, float], mirrored_px: int | None) -> tuple[Array, Array]:
    """How pixels map to those of the turned camera (3, 3), and its intrinsics (3, 3).

    Args:
        K: intrinsics of the camera before.
        R: how it is turned.
        stretch: factors of the pixels along x and y.
        mirrored_px: width of the picture if it is mirrored; else None.
    """
    pixels = np.diag([*stretch, 1.0])
    pixels[:2, 2] = (np.array(stretch) - 1) / 2  # centres of pixels are whole numbers
    now = pixels @ K
    if mirrored_px is not None:
        flip = np.array([[-1.0, 0.0, mirrored_px - 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        return flip @ now @ R @ np.linalg.inv(K), flip @ now @ np.diag([-1.0, 1.0, 1.0])
    return now @ R @ np.linalg.inv(K), now
