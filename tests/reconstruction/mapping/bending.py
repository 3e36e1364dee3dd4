"""Sheets that bend and keep every length exactly, seen by a perspective camera."""

import numpy as np

from reconstruction.camera import Camera

CAMERA = Camera(600.0, np.array([320.0, 240.0]))


def bent(uv: np.ndarray, direction: float, slope: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Points (3, p) of the sheet's (2, p), bent along a direction: slope (k,) in radians along arc length grid (k,)."""
    c, s = np.cos(direction), np.sin(direction)
    along, across = c * uv[0] + s * uv[1], -s * uv[0] + c * uv[1]
    step = grid[1] - grid[0]
    x = np.concatenate([[0.0], np.cumsum(np.cos((slope[1:] + slope[:-1]) / 2)) * step])
    z = np.concatenate([[0.0], np.cumsum(np.sin((slope[1:] + slope[:-1]) / 2)) * step])
    x, z = np.interp(along, grid, x - x.mean()), np.interp(along, grid, z - z.mean())
    return np.stack([c * x - s * across, s * x + c * across, z])


def turned(x: float, y: float) -> np.ndarray:
    """Rotation about y, then x."""
    cx, sx, cy, sy = np.cos(x), np.sin(x), np.cos(y), np.sin(y)
    return np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])


def waving_sheet(
    rng: np.random.Generator, frames: int = 12, points: int = 150, amplitude: float = 0.5, noise_px: float = 0.1
) -> tuple[np.ndarray, np.ndarray]:
    """Images (F, 2, p) px and true shapes (F, 3, p) of a sheet 1.2 wide at a distance of 3, never flat."""
    uv = np.stack([rng.uniform(-0.6, 0.6, points), rng.uniform(-0.45, 0.45, points)])
    direction, phases, grid = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi, 5), np.linspace(-0.8, 0.8, 800)
    shapes = []
    for w in 2 * np.pi * np.arange(frames) / frames:
        slope = amplitude * (np.sin(2 * np.pi * grid / 1.2 + w + phases[0]) + 0.4 * np.sin(2 * w + phases[1]))
        R = turned(0.45 * np.sin(w + phases[2]), 0.5 * np.sin(2 * w + phases[3]))
        shape = R @ bent(uv, direction + 0.5 * np.sin(w + phases[4]), slope, grid)
        shapes.append(shape + np.array([0.1 * np.sin(w), 0.1 * np.cos(w), 3.0])[:, None])
    S = np.array(shapes)
    return CAMERA.project(S) + noise_px * rng.standard_normal((frames, 2, points)), S


def lifted_page(rng: np.random.Generator, frames: int = 16, points: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """The same of a sheet that is held flat at one side and lifted at the other."""
    uv, grid = np.stack([rng.uniform(-0.6, 0.6, points), rng.uniform(-0.45, 0.45, points)]), np.linspace(-0.8, 0.8, 800)
    direction, turn, shapes = rng.uniform(-0.4, 0.4), rng.uniform(0, 2 * np.pi, 2), []
    for time in np.arange(frames) / frames:
        slope = -1.3 * np.sin(np.pi * time) ** 2 * np.clip((grid + 0.3) / 0.42, 0, 1)
        R = turned(0.2 * np.sin(4 * time + turn[0]), 0.2 * np.sin(4 * time + turn[1]))
        shapes.append(R @ bent(uv, direction, slope, grid) + np.array([0.0, 0.0, 2.6])[:, None])
    S = np.array(shapes)
    return CAMERA.project(S) + 0.2 * rng.standard_normal((frames, 2, points)), S


def stretching_sheet(
    rng: np.random.Generator, stretch: float, frames: int = 10, points: int = 120
) -> tuple[np.ndarray, np.ndarray]:
    """The same of a sheet that bends little, does not turn, and is pulled about in its plane."""
    uv, grid, shapes = rng.uniform(-1, 1, (2, points)) * [[0.6], [0.45]], np.linspace(-0.8, 0.8, 800), []
    for _ in range(frames):
        a, b, c = rng.uniform(0, 2 * np.pi, 3)
        pulled = uv + stretch / 4 * np.stack([np.sin(3 * uv[1] + a) * np.cos(4 * uv[0] + b), np.sin(4 * uv[0] + c)])
        slope = 0.2 * np.sin(5 * grid + rng.uniform(0, 2 * np.pi))
        shapes.append(bent(pulled, rng.uniform(0, np.pi), slope, grid) + np.array([0.0, 0.0, 2.0])[:, None])
    S = np.array(shapes)
    return CAMERA.project(S) + 0.2 * rng.standard_normal((frames, 2, points)), S


def folding_sheet(
    rng: np.random.Generator,
    creases: tuple[float, ...] = (0.1,),
    noise_px: float = 0.1,
    frames: int = 15,
    points: int = 220,
) -> tuple[np.ndarray, np.ndarray]:
    """The same of a sheet that is flat but for creases from top to bottom at such places across; each opens and closes."""
    uv, grid = np.stack([rng.uniform(-0.6, 0.6, points), rng.uniform(-0.45, 0.45, points)]), np.linspace(-0.8, 0.8, 3201)
    turn, shapes = rng.uniform(0, 2 * np.pi, 4), []
    for w in 2 * np.pi * np.arange(frames) / frames:
        folds = [0.7 + 0.6 * np.sin(w + 2 * k) for k in range(len(creases))]
        slope = sum(fold * ((grid > at) - 0.5) for fold, at in zip(folds, creases, strict=True))
        R = turned(0.3 * np.sin(w + turn[0]), 0.4 * np.sin(2 * w + turn[1]))
        shift = np.array([0.1 * np.sin(w + turn[2]), 0.1 * np.cos(w + turn[3]), 2.2])
        shapes.append(R @ bent(uv, 0.0, np.asarray(slope), grid) + shift[:, None])
    S = np.array(shapes)
    return CAMERA.project(S) + noise_px * rng.standard_normal((frames, 2, points)), S
