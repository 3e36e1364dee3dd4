"""A small made-up run, written through `app.recording.recording`: a sheet in four colours that waves before the camera."""

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun_cli
from numpy.typing import NDArray

from app.recording.recording import Recording
from reconstruction.basis.mesh import Mesh, triangulate
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.modes import modal_basis
from reconstruction.camera import Camera, quaternion_exp, rotation_from_quaternion
from reconstruction.estimate import ShapeEstimate
from tracking.observation import Observation
from tracking.video import Frame

SIZE = (160, 120)
MODES = 4
COLUMNS, ROWS = 8, 6
CORNERS_BGR = ((40, 40, 220), (60, 200, 60), (220, 80, 40), (40, 220, 220))  # top left, top right, bottom left, right
STAGE_MS = {"decode": 1.0, "track": 12.5, "reconstruct": 7.0, "record": 2.0}


@dataclass(frozen=True)
class Run:
    """What was written, to be found again."""

    path: Path
    picture: NDArray[np.uint8]
    pixels: NDArray[np.float64]
    camera: Camera
    mesh: Mesh
    basis: ModalBasis
    observations: list[Observation]
    estimates: list[ShapeEstimate]


def picture() -> NDArray[np.uint8]:
    """A sheet of four coloured quarters before a bright wall."""
    image = np.full((SIZE[1], SIZE[0], 3), 215, np.uint8)
    for color, (y, x) in zip(CORNERS_BGR, ((20, 30), (20, 80), (60, 30), (60, 80)), strict=True):
        image[y : y + 40, x : x + 50] = color
    return image


def write_run(
    path: Path,
    *,
    frames: int = 6,
    first_shape: int = 2,
    camera: Camera | None = None,
    unsure: bool = True,
    **options: object,
) -> Run:
    """Write `frames` frames; every third point is hidden in odd frames, and shapes are known from `first_shape` on.

    As in a real run, the frames before it get their shapes when the rest shape is known.
    """
    image = picture()
    camera = camera or Camera(200.0, np.array([80.0, 60.0]))
    x, y = np.meshgrid(np.linspace(35, 125, COLUMNS), np.linspace(25, 95, ROWS))
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    mesh = triangulate(pixels + 0.01 * np.sin(np.arange(pixels.size)).reshape(pixels.shape))
    rest = np.vstack([(pixels - camera.center_px).T, np.zeros(len(pixels))])
    basis = modal_basis(rest, mesh, MODES)
    origin = np.append(rest[:2].mean(axis=1), camera.focal_px if camera.perspective else 0.0)
    observations, estimates = [], []
    for index in range(frames):
        q = quaternion_exp(np.array([0.0, 0.3 * np.sin(0.3 * index), 0.0]))
        Lambda = np.zeros((3, MODES))
        Lambda[2] = 15.0 * np.sin(0.4 * index + np.arange(MODES))
        R = rotation_from_quaternion(q)
        shape = R @ basis.deform(Lambda) + origin[:, None]
        projection = camera.project(shape).T
        visible = (np.arange(len(pixels)) % 3 > 0) | (index % 2 == 0)
        observed = np.where(visible[:, None], projection + 0.5, np.nan)
        residual = np.where(visible, np.sqrt(0.5), np.nan)
        observations.append(Observation(observed, visible))
        pose = q, R, origin[:2], 1.0
        sigma = np.linspace(0.0, 8.0, len(pixels)) + index if unsure else None
        estimates.append(ShapeEstimate(index, *pose, Lambda, shape, projection, residual, visible, sigma=sigma))
    run = Run(path, image, pixels, camera, mesh, basis, observations, estimates)
    configuration: Mapping[str, object] = {"source": "sheet.mp4", "modes": MODES} | {
        name: value for name, value in options.items() if name == "image_width"
    }
    with Recording(path, configuration=configuration, size=SIZE, **options) as recording:  # type: ignore[arg-type]
        for index in range(frames):
            time_s = index / 30
            phase = "tracking" if index >= first_shape else "bootstrap"
            recording.observe(Frame(index, time_s, image), observations[index], phase=phase)
            if index == first_shape:
                recording.rest(basis, mesh, camera, image, pixels)
                recording.event(index, time_s, "rest shape: plane")
            for known in range(first_shape + 1) if index == first_shape else (index,):
                if index >= first_shape:
                    recording.estimate(known, known / 30, estimates[known])
            recording.timing(index, time_s, STAGE_MS)
        recording.summary({"frames": frames, "e3d": 0.03})
    return run


def verify(path: Path) -> None:
    """Fail unless Rerun itself finds the recording whole."""
    program = Path(rerun_cli.__file__).with_name("rerun")
    done = subprocess.run([program, "rrd", "verify", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
