"""Shapes from a video, frame by frame."""

import atexit
import logging
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict
from math import isinf
from os import PathLike
from pathlib import Path

import numpy as np

from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.processed import Processed
from app.pipeline.session import Session
from app.terminal.progress import Progress
from modeshape.estimate import Frame
from reconstruction.settings import Settings

LOG = logging.getLogger("modeshape")


class Logged(Progress):
    """What the command tells on the terminal goes to the log of whoever uses the package."""

    def __enter__(self) -> "Logged":
        return self

    def log(self, text: str) -> None:
        """A line."""
        LOG.info(text)


def reconstruct(
    source: str | PathLike[str] | int,
    *,
    region: tuple[int, int, int, int] | None = None,
    mask: str | PathLike[str] | None = None,
    frames: tuple[int, int | None] = (0, None),
    points: int = 800,
    focal_px: float | None = None,
    rest_mesh: str | PathLike[str] | None = None,
    settings: Settings | None = None,
    recording: str | PathLike[str] | None = None,
    overwrite: bool = False,
) -> Iterator[Frame]:
    """Follow the surface in a video; frames come in order, each once its shape is known, while the video is read.

    The first frames (10 to 60, as needed) give the rest shape and come together. Leaving the loop early ends the
    run; a recording is complete then, too. Meanwhile NumPy uses one thread.

    Args:
        source: video file, image pattern (img%04d.png), camera index or URL.
        region: x, y, width, height px of the surface in the first frame; without it, the whole frame is searched.
        mask: picture of the video's size, white where the surface is in the first frame.
        frames: the first frame, and the one after the last or None.
        points: most points tracked.
        focal_px: focal length; infinite for an orthographic camera; None: found where the views hold it,
            else the width of the picture.
        rest_mesh: file of the rest shape: x, y px of the first frame, z relative depth; without it, from the first frames.
        settings: how to reconstruct.
        recording: file (.rrd) to write what `modeshape run` records.
        overwrite: whether that may replace an existing one.

    Raises:
        ValueError: an argument that cannot be used; with the first frame, a source that cannot.

    >>> import modeshape
    >>> for frame in modeshape.reconstruct("paper.mp4", region=(135, 123, 341, 243), points=120):
    ...     if not frame.lost:
    ...         depth_px = frame.shape[:, 2]
    >>> frame.index, frame.shape.shape, frame.visible.shape
    (69, (120, 3), (120,))
    """
    settings = settings or Settings()
    if region is not None and len(region) != 4:
        raise ValueError(f"region {region} has {len(region)} numbers: give x, y, width, height")
    config = Run(
        source=str(source),
        roi=region and (round(region[0]), round(region[1]), round(region[2]), round(region[3])),
        mask=None if mask is None else Path(mask),
        frames=f"{frames[0]}:{'' if frames[1] is None else frames[1]}",
        points=points,
        rest_shape=settings.rest_shape if rest_mesh is None else str(rest_mesh),
        camera="orthographic" if focal_px is not None and isinf(focal_px) else "perspective",
        model=Model(**asdict(settings), focal="auto" if focal_px is None else float(focal_px)),
        output=Output(out=None if recording is None else Path(recording), overwrite=overwrite),
    )
    return _frames(Session(config, Logged(), record=False))


def _frames(session: Session) -> Iterator[Frame]:
    surface, number = None, 1
    with closing(session.frames()) as processed, closed_at_exit(processed):
        for one in processed:
            if surface is not None and one.surface is not None and one.surface.points_px is not surface.points_px:
                number += 1
            surface = one.surface
            yield _frame(one, number)
    if session.interrupted:  # it has ended the run, and is for the caller, too
        raise KeyboardInterrupt


@contextmanager
def closed_at_exit(frames: Generator[Processed, None, None]) -> Iterator[None]:
    """Frames of a run that is left half-way end with the program, while it still has threads and signals."""
    atexit.register(frames.close)
    try:
        yield
    finally:
        atexit.unregister(frames.close)


def _frame(one: Processed, number: int) -> Frame:
    seen, estimate, surface = one.observation, one.estimate, one.surface
    nothing = np.full((len(seen.visible), 3), np.nan)
    return Frame(
        index=one.frame.index,
        shape=nothing if estimate is None else estimate.shape.T,
        faces=np.empty((0, 3), np.int64) if surface is None else surface.model.mesh.faces,
        visible=seen.visible if estimate is None else estimate.visible,
        points_px=np.where(seen.visible[:, None], seen.points_px, np.nan),
        projection_px=nothing[:, :2] if estimate is None else estimate.projection_px,
        sigma=None if estimate is None else estimate.sigma,
        time_s=one.frame.time_s,
        image=one.frame.image,
        surface=number,
        focal_px=np.nan if surface is None else surface.model.camera.focal_px,
    )
