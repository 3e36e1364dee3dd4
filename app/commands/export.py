"""`modeshape export`: a recording as files for other programs; from the recording alone."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from app.arrays import Array
from app.files.writing import check_free_folder, check_outputs, moved_when_complete, writable, writable_folder
from app.options.export import Export
from app.playback.playback import Playback
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from app.terminal.summary import Summary
from reconstruction.basis.surface import Surface

if TYPE_CHECKING:
    from app.files.scenes.gltf import MovingMesh

FOLDERS = ("obj", "ply", "csv")  # formats with more than one file
VIDEOS = ("mp4", "webm")
OWN_FILES = (
    "frame_*.obj",
    "frame_*.ply",
    "surface.mtl",
    "texture.png",
    "points.csv",
    "frames.csv",
    "lambda.csv",
    "mesh.csv",
)
UPRIGHT = np.array([1.0, -1.0, -1.0])  # half a turn about x: y up, z towards the viewer


@dataclass(frozen=True)
class Exported(Summary):
    """What was written."""

    exported: Path
    format: str
    frames: int
    frames_with_shape: int
    points: int
    out: Path
    megabytes: float


def export(command: Export, progress: Progress) -> Exported:
    """Carry out the command.

    Returns:
        what was written.

    Raises:
        UsageError: a recording that cannot be read, that has no model or no pictures, or files that cannot be written.
    """
    kind = command.kind
    out = command.out or default_path(command.recording, kind)
    if kind in FOLDERS:
        check_free_folder(out, overwrite=command.overwrite)
    playback = Playback.load(command.recording, online=command.online)
    for note in playback.notes:
        progress.log(note)
    _ = playback.model  # a UsageError if there is none
    if not playback.shaped.any():
        raise UsageError(f"{playback.path} contains no shape: run again for longer")
    if kind not in FOLDERS:
        check_outputs({"--out": out}, [command.recording], overwrite=command.overwrite)
    with progress:
        progress.expect(len(playback.frames) if kind in (*VIDEOS, "csv") else int(playback.shaped.sum()))

        def advance() -> None:
            progress.advance("writing")

        if kind == "glb":
            write_glb(playback, out, command.color)
        elif kind == "usdz":
            write_usdz(playback, out, command.color)
        elif kind == "npz":
            from app.playback.tables import write_npz

            with writable(out) as file:
                write_npz(playback, file, advance)
        elif kind == "csv":
            from app.playback.tables import write_csv

            with writable_folder(out, OWN_FILES) as folder:
                write_csv(playback, folder, advance)
        elif kind in VIDEOS:
            write_video(playback, out, advance)
        else:
            with writable_folder(out, OWN_FILES) as folder:
                write_meshes(playback, folder, command, advance)
    return Exported(
        exported=playback.path,
        format=kind,
        frames=len(playback.frames),
        frames_with_shape=int(playback.shaped.sum()),
        points=playback.W.shape[2],
        out=out,
        megabytes=megabytes(out),
    )


def write_glb(playback: Playback, out: Path, color: Literal["picture", "strain", "curvature"]) -> None:
    """An animated mesh as glTF."""
    from app.files.scenes.gltf import glb

    moving = moving_mesh(playback, color)
    with writable(out) as file:
        file.write(glb(moving, playback.name))


def write_usdz(playback: Playback, out: Path, color: Literal["picture", "strain", "curvature"]) -> None:
    """An animated mesh as USD.

    Raises:
        UsageError: the library is not installed.
    """
    try:
        from app.files.scenes import usd
    except ImportError as error:
        raise UsageError("USD needs a library of its own: pip install 'modeshape[usd]'") from error
    moving = moving_mesh(playback, color)
    with moved_when_complete(out) as part:
        part.unlink()  # the library makes it
        usd.write_usdz(moving, part, playback.name)


def moving_mesh(playback: Playback, color: Literal["picture", "strain", "curvature"]) -> "MovingMesh":
    """The surface in motion; frames without a shape hold the last one."""
    from app.files.scenes.gltf import MovingMesh

    camera, (width, height) = playback.camera, playback.size
    s = held(playback.estimates.s)
    t = held(playback.estimates.t)
    if camera.perspective:
        origin = np.column_stack([t, np.full(len(t), camera.focal_px)]) / s[:, None]
        scale = np.ones(len(s))
        view = (2 * float(np.arctan(height / (2 * camera.focal_px))), width / height)
    else:
        origin, scale, view = np.column_stack([t, np.zeros(len(t))]), s, None
    return MovingMesh(
        basis=playback.basis,
        faces=playback.mesh.faces,
        uv=texture_coordinates(playback),
        texture_bgr=playback.texture_bgr,
        times_s=playback.times_s,
        quaternion=held(playback.estimates.quaternion),
        origin=origin,
        scale=scale,
        Lambda=held(playback.estimates.Lambda),
        field_of_view=view,
        unit_m=1e-3 if playback.unit == "millimetres" else None,
        colors=None if color == "picture" else greatest(playback, color),
    )


def greatest(playback: Playback, what: Literal["strain", "curvature"]) -> Array:
    """Colours (p, 3) from blue over white to red of the greatest strain or curvature of each vertex, of either sign."""
    surface = Surface(playback.basis.rest, playback.mesh.faces)
    of = surface.strain if what == "strain" else surface.curvature
    values = np.stack([of(shape) for shape in playback.shapes()[playback.shaped]])
    values = np.nan_to_num(values)[np.abs(np.nan_to_num(values)).argmax(axis=0), np.arange(values.shape[1])]
    level = (values / max(float(np.quantile(np.abs(values), 0.98)), 1e-12)).clip(-1, 1)[:, None]
    return np.asarray(np.where(level > 0, [1.0, 0.1, 0.05], [0.05, 0.2, 1.0]) * np.abs(level) + 1 - np.abs(level))


def write_meshes(playback: Playback, folder: Path, command: Export, advance: Callable[[], None]) -> None:
    """A mesh file for each frame with a shape."""
    from app.files.mesh_sequence import MeshSequence

    upright = command.axes == "y-up"
    axes = "x right, y up, z towards the viewer" if upright else "x right, y down, z forward (camera axes)"
    comment = f"modeshape {playback.version}; {axes}; unit: {playback.unit}"
    kind: Literal["obj", "ply"] = "obj" if command.kind == "obj" else "ply"
    sequence = MeshSequence(folder, kind, playback.mesh.faces, texture_coordinates(playback), comment)
    sequence.texture(cv2.imencode(".png", playback.texture_bgr)[1].tobytes())
    for i in np.flatnonzero(playback.shaped).tolist():
        estimate = playback.estimate(i)
        assert estimate is not None
        vertices = estimate.shape.T
        sequence.add(int(playback.frames[i]), vertices * UPRIGHT if upright else vertices)
        advance()


def write_video(playback: Playback, out: Path, advance: Callable[[], None]) -> None:
    """The pictures with mesh, points and reprojections drawn over them, at the video's pace."""
    from app.files.video_out import usual_fps, writable_video
    from app.playback.overlay import enlarged, overlaid

    with writable_video(out, enlarged(playback.size), usual_fps(playback.times_s)) as video:
        for i, image in overlaid(playback):
            video.write(image, float(playback.times_s[i]))
            advance()


def held(values: Array) -> Array:
    """Rows (F, …) with those that are NaN replaced by the last one before that is not, at the start by the first one."""
    known = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    index = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.asarray(values[np.where(index < 0, int(known.argmax()), index)])


def texture_coordinates(playback: Playback) -> Array:
    """Texture coordinates (p, 2) of the vertices, 0 … 1 from the top left corner; pixel centres are at halves."""
    height, width = playback.texture_bgr.shape[:2]
    return np.asarray((playback.texture_px - playback.texture_origin + 0.5) / (width, height))


def default_path(recording: Path, kind: str) -> Path:
    """A path beside the recording; that of a video differs from its source's name."""
    if kind in FOLDERS:
        return recording.with_name(f"{recording.stem}_{kind}")
    return recording.with_name(f"{recording.stem}{'-overlay' if kind in VIDEOS else ''}.{kind}")


def megabytes(path: Path) -> float:
    """Size of a file, or of all files in a folder."""
    files = [path] if path.is_file() else list(path.iterdir())
    return round(sum([file.stat().st_size for file in files]) / 1e6, 3)
