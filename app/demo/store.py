"""The sample on disk: the video, its truth and the page it shows, made once and kept in the user's cache."""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from app.demo.camera import PAGE, SIZE, K, occluder, project, render, shading, true_shape
from app.demo.motion import FPS, FRAMES, HEIGHT_MM, WIDTH_MM, grid, surface
from app.terminal.errors import UsageError

TRUTH_EVERY = 4
_ROI_INSET_PX = 8


@dataclass(frozen=True)
class Sample:
    """Where the sample lies. All files belong together."""

    video: Path
    """640×480, 30 frames a second, FRAMES frames."""
    truth: Path
    """An .npz with, for K = every TRUTH_EVERY-th frame and P points of a grid that covers the sheet:

    `W_px` (K, 2, P) pixels; `S_gt` (K, 3, P) mm, camera axes; `gt_frames` (K,); `K` (3, 3) intrinsics;
    `uv` (P, 2) texture coordinates, 0 … 1 from the top left corner; `faces` (m, 3); `shading` (K, P) the
    light on each point, as a factor to the printed colour; `occluder` (K, 480, 640) bool, where the hand is.
    """
    texture: Path
    """The page as printed, a PNG from edge to edge of the sheet, without light or noise."""
    roi: tuple[int, int, int, int]
    """x, y, width, height in pixels: where the sheet is in frame 0, a little inside its bounding box."""


def sample(folder: Path | None = None, progress: Callable[[int, int], None] | None = None) -> Sample:
    """The sample, made now if it is not there yet or was made by another version of this package.

    folder: where samples are kept, by default `$XDG_CACHE_HOME/modeshape` or `~/.cache/modeshape`.
    progress: called with the number of frames done and their total, only while rendering.
    Raises UsageError if the folder cannot be written.
    """
    home = (folder or _cache()) / f"sample-{_version()}"
    made = Sample(home / "sheet.mp4", home / "sheet_gt.npz", home / "sheet.png", _roi())
    if not all(path.is_file() for path in (made.video, made.truth, made.texture)):
        try:
            home.mkdir(parents=True, exist_ok=True)
            # Complete files are moved into place one by one: an interrupted run leaves none half written.
            with tempfile.TemporaryDirectory(dir=home, ignore_cleanup_errors=True) as unfinished:
                shutil.copyfile(PAGE, Path(unfinished) / made.texture.name)
                _write_truth(Path(unfinished) / made.truth.name)
                _write_video(Path(unfinished) / made.video.name, progress)
                for path in (made.texture, made.truth, made.video):
                    (Path(unfinished) / path.name).replace(path)
        except OSError as error:
            raise UsageError(
                f"cannot write the sample video to {home}: {error.strerror or error}; "
                "set XDG_CACHE_HOME to a folder that can be written"
            ) from error
    return made


def _cache() -> Path:
    root = os.environ.get("XDG_CACHE_HOME")
    return (Path(root) if root else Path.home() / ".cache") / "modeshape"


def _version() -> str:
    """A digest of everything the sample is made by: code and pictures of this package, and the library that draws."""
    digest = hashlib.sha256(cv2.__version__.encode())
    for source in sorted(Path(__file__).parent.glob("*.p*")):
        digest.update(source.read_bytes())
    return digest.hexdigest()[:12]


def _roi() -> tuple[int, int, int, int]:
    corners = project(true_shape(0))
    left, top = np.ceil(corners.min(axis=0)).astype(int) + _ROI_INSET_PX
    right, bottom = np.floor(corners.max(axis=0)).astype(int) - _ROI_INSET_PX
    return int(left), int(top), int(right - left), int(bottom - top)


def _write_truth(path: Path) -> None:
    frames = np.arange(0, FRAMES, TRUTH_EVERY)
    xy_mm, faces = grid()
    shapes = [true_shape(int(frame)) for frame in frames]
    np.savez_compressed(
        path,
        W_px=np.stack([project(shape).T for shape in shapes]),
        S_gt=np.stack([shape.T for shape in shapes]),
        gt_frames=frames,
        K=K,
        uv=xy_mm / (WIDTH_MM, HEIGHT_MM) + 0.5,
        faces=faces,
        shading=np.stack([shading(surface(int(frame)), xy_mm) for frame in frames]),
        occluder=np.stack([occluder(int(frame)) for frame in frames]),
    )


def _write_video(path: Path, progress: Callable[[int, int], None] | None) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), FPS, SIZE)
    if not writer.isOpened():
        raise OSError("OpenCV does not open an mp4 file for writing there")
    try:
        for frame in range(FRAMES):
            writer.write(render(frame))
            if progress is not None:
                progress(frame + 1, FRAMES)
    finally:
        writer.release()
