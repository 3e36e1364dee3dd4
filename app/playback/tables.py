"""A recording as tables: CSV files in a folder for spreadsheets, or one .npz for NumPy."""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from app.arrays import Array, Indices
from app.playback.playback import Playback
from reconstruction.basis.modal_basis import ROW_NAMES
from reconstruction.basis.surface import Surface
from reconstruction.camera import rotation_from_quaternion
from reconstruction.estimate import ShapeEstimate


def camera_path(playback: Playback, rows: Indices) -> tuple[Array, Array]:
    """The camera as the object sees it, in the axes of the rest shape: rotations (n, 3, 3) and positions (n, 3) px.

    A rotation's columns are the camera's x (right), y (down) and z (forward). An orthographic camera has no
    position: NaN.
    """
    R = rotation_from_quaternion(playback.estimates.quaternion[rows])
    camera = playback.camera
    if not camera.perspective:
        return R.transpose(0, 2, 1), np.full((len(R), 3), np.nan)
    s, t = playback.estimates.s[rows], playback.estimates.t[rows]
    origin = np.column_stack([t, np.full(len(t), camera.focal_px)]) / s[:, None]
    return R.transpose(0, 2, 1), -np.einsum("fji,fj->fi", R, origin)


def write_npz(playback: Playback, file: BinaryIO, advance: Callable[[], None]) -> None:
    """Everything as arrays; rows are the F frames that have a shape, or NaN where the surface was lost; P points, r modes.

    The keys of --shapes-out, with the same values: S (F, 3, P) shapes in camera axes, R (F, 3, 3), s (F,), t (F, 2),
    Lambda (F, 3, r), visible (F, P), frames (F,), faces (m, 3), rest (3, P), Upsilon (r, P), eigenvalues (r,), Phi (3, 3),
    K (3, 3), perspective. Besides: W (F, 2, P) observed px, NaN where not visible; projection (F, 2, P) px of the
    shapes; times_s (F,); quaternion (F, 4) of R, w first; camera_R, camera_position (see `camera_path`);
    texture_px (P, 2) the points in the first frame; strain, curvature (F, P); with --uncertainty sigma (F, P).
    """
    rows = np.flatnonzero(playback.shaped | (np.array([phase.lower() for phase in playback.phases]) == "lost"))
    shapes = np.full((len(rows), *playback.basis.rest.shape), np.nan)
    projections = np.full((len(rows), 2, shapes.shape[2]), np.nan)
    for k, row in enumerate(rows.tolist()):
        if estimate := playback.estimate(row):
            shapes[k], projections[k] = estimate.shape, estimate.projection_px.T
        advance()
    basis, camera, sigma = playback.basis, playback.camera, playback.estimates.sigma[rows]
    camera_R, camera_position = camera_path(playback, rows)
    own = np.isin(rows, [*playback.estimates.before], invert=True)[:, None, None]  # not of another model
    arrays: dict[str, Any] = {
        "S": shapes,
        "R": np.where(own, camera_R.transpose(0, 2, 1), np.nan),
        "s": playback.estimates.s[rows],
        "t": playback.estimates.t[rows],
        "Lambda": np.where(own, playback.estimates.Lambda[rows], np.nan),
        "visible": playback.visible[rows],
        "frames": playback.frames[rows],
        "faces": playback.mesh.faces,
        "rest": basis.rest,
        "Upsilon": basis.Upsilon,
        "eigenvalues": basis.eigenvalues,
        "Phi": basis.Phi,
        "K": camera.K,
        "perspective": camera.perspective,
        "W": playback.W[rows],
        "projection": projections,
        "times_s": playback.times_s[rows],
        "quaternion": playback.estimates.quaternion[rows],
        "camera_R": camera_R,
        "camera_position": camera_position,
        "texture_px": playback.texture_px,
    }
    surface = Surface(basis.rest, playback.mesh.faces)
    arrays["strain"] = np.stack([surface.strain(shape) for shape in shapes])
    arrays["curvature"] = np.stack([surface.curvature(shape) for shape in shapes])
    if np.isfinite(sigma).any():
        arrays["sigma"] = sigma
    np.savez_compressed(file, **arrays)


def write_csv(playback: Playback, folder: Path, advance: Callable[[], None]) -> None:
    """Four tables, every frame of the recording; what is not known is left empty.

    points.csv: frame, time_s, point, visible, observed_x/y px, projected_x/y px, x, y, z of the shape (camera axes,
    pixels of the first frame or millimetres), sigma (their standard deviation, with --uncertainty), strain and curvature,
    one line for each point of each frame. frames.csv: frame, time_s, phase, and the pose of the object: qw, qx, qy, qz,
    tx, ty px, s; camera_x/y/z and camera_qw … qz: the camera in the axes of the rest shape. lambda.csv: frame, time_s,
    alpha_1 … tau_r. mesh.csv: the triangles' points a, b, c.
    """
    shaped = np.flatnonzero(playback.shaped)
    _, positions = camera_path(playback, shaped)
    position = dict(zip(shaped.tolist(), positions, strict=True))
    modes = playback.estimates.Lambda.shape[2]
    names = [f"{row}_{k}" for row in ROW_NAMES for k in range(1, modes + 1)]
    times = [(int(frame), round(float(time), 6)) for frame, time in zip(playback.frames, playback.times_s, strict=True)]

    pose = ["qw", "qx", "qy", "qz", "tx", "ty", "s"]
    camera_columns = ["camera_x", "camera_y", "camera_z", "camera_qw", "camera_qx", "camera_qy", "camera_qz"]

    def pose_row(i: int) -> list[object]:
        q = playback.estimates.quaternion[i]
        camera = position.get(i, np.full(3, np.nan))
        values = [*q, *playback.estimates.t[i], playback.estimates.s[i], *camera, *(q * (1, -1, -1, -1))]
        return [*times[i], playback.phases[i], *cells(values)]

    frames = range(len(times))
    table(folder / "frames.csv", ["frame", "time_s", "phase", *pose, *camera_columns], map(pose_row, frames))
    table(
        folder / "lambda.csv",
        ["frame", "time_s", *names],
        ([*times[i], *cells(playback.estimates.Lambda[i].ravel())] for i in frames),
    )
    table(folder / "mesh.csv", ["a", "b", "c"], playback.mesh.faces.tolist())

    surface = Surface(playback.basis.rest, playback.mesh.faces)

    def row_of(estimate: ShapeEstimate, i: int) -> Array:
        place = [estimate.projection_px, estimate.shape.T, playback.estimates.sigma[i]]
        return np.column_stack([*place, surface.strain(estimate.shape), surface.curvature(estimate.shape)])

    def point_rows() -> Iterable[list[object]]:
        for i in frames:
            estimate = playback.estimate(i)
            unknown = np.full((playback.W.shape[2], 8), np.nan)
            values = np.column_stack([playback.W[i].T, unknown if estimate is None else row_of(estimate, i)])
            for point, (visible, row) in enumerate(zip(playback.visible[i], values.tolist(), strict=True)):
                yield [*times[i], point, int(visible), *cells(row)]
            advance()

    columns = ["observed_x", "observed_y", "projected_x", "projected_y", "x", "y", "z", "sigma", "strain", "curvature"]
    table(folder / "points.csv", ["frame", "time_s", "point", "visible", *columns], point_rows())


def table(path: Path, head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """A CSV file with a line of names."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(head)
        writer.writerows(rows)


def cells(values: Iterable[float]) -> list[str]:
    """Numbers as they are written, the unknown ones empty."""
    return ["" if value != value else f"{value:.9g}" for value in values]
