"""`modeshape retexture`: a picture on the moving surface: in a recording, in a video, or live while a camera is tracked."""

import sys
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import cast

import cv2
import numpy as np

from app.arrays import Image
from app.files.video_out import check_video_format, usual_fps
from app.files.writing import check_outputs
from app.options.retexture import Retexture
from app.options.run import parse_range
from app.painting.painter import Painter
from app.painting.picture import Texture
from app.painting.placement import Placement, corners_of, in_first_frame, outline_of
from app.pipeline.session import Session
from app.pipeline.summary import RunSummary
from app.playback.playback import Playback
from app.terminal.errors import UsageError
from app.terminal.exit_code import ExitCode
from app.terminal.interrupts import completed
from app.terminal.progress import Progress
from app.terminal.summary import Summary
from tracking.observation import Observation
from tracking.video import Frame, Video

RRD_MAGIC = b"RRF"
STILL_PX = 1.0


@dataclass(frozen=True)
class Played(Summary):
    """A recording whose pictures were painted on."""

    source: str
    frames: int
    interrupted: bool

    @property
    def exit_code(self) -> ExitCode:
        """Whether it was interrupted."""
        return ExitCode.INTERRUPTED if self.interrupted else ExitCode.DONE


@dataclass(frozen=True)
class Painted(Summary):
    """What was painted, after what it was painted on."""

    on: RunSummary | Played
    painted_frames: int
    paint_ms: float | None
    out: Path

    @property
    def hint(self) -> str:
        """Of a run, how to look at the recording."""
        return self.on.hint

    @property
    def exit_code(self) -> ExitCode:
        """Whether it was interrupted."""
        return self.on.exit_code


def retexture(command: Retexture, progress: Progress) -> Painted:
    """Carry out the command.

    Returns:
        what was written.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
    """
    check_video_format(command.out)
    inputs = (command.source, command.texture, command.mask)
    check_outputs({"--out": command.out, "--rrd": command.rrd}, inputs, overwrite=command.overwrite)
    placement = Placement(corners_of(command.place), command.opacity, outline_of(command.outline))
    if command.place_frame is not None and (command.place is None or command.run.live):
        raise UsageError("--place-frame goes with --place, of a recording or a video file")
    with Texture(command.texture) as texture, Painter(command.out, texture, placement) as painter:
        way = play if is_recording(command.source) else follow if command.run.live else reconstruct
        on = way(command, painter, progress)
    return Painted(on, painter.painted, painter.milliseconds, command.out)


def reconstruct(command: Retexture, painter: Painter, progress: Progress) -> RunSummary:
    """Paint the frames of a video file, once its last one has told all there is to know of the surface.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
    """
    run = command.run
    with TemporaryDirectory() as folder:
        kept = command.rrd is not None
        output = replace(run.output, out=command.rrd or Path(folder) / "run.rrd", image="jpeg" if kept else "none")
        session = Session(replace(run, output=output), progress)
        summary = session.run()
        with Video(run.source, *run.frame_range, duration_s=run.duration) as video, progress:
            progress.expect(summary.frames)
            frames = iter(video)
            for playback in (Playback.load(path) for path in session.recordings):
                wanted = playback.frames[0]  # a run leaves out black frames and titles at the beginning
                recorded = (frame for frame in frames if frame.index >= wanted)
                for i, frame in zip(range(len(playback.frames)), recorded, strict=False):
                    if i == 0 and playback.recorded_model is not None:
                        if not painter.begun:
                            painter.placement = placed(command, playback, painter.placement)
                        painter.begin(frame, playback.texture_px, playback.model, video.fps)
                    estimate = playback.estimate(i) if playback.recorded_model is not None else None
                    painter.frame(frame, Observation(playback.W[i].T, playback.visible[i]), estimate)
                    progress.advance("painting")
    return summary if kept else replace(summary, recording=None)


def follow(command: Retexture, painter: Painter, progress: Progress) -> RunSummary:
    """Paint the frames of a camera or stream while it is tracked.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
    """
    run = command.run
    as_it_is = replace(run.output, image_width=sys.maxsize)  # of pictures that are painted nothing is lost
    session = Session(replace(run, output=as_it_is), progress, record=False)
    surface = None
    with closing(session.frames()) as frames:
        for one in frames:
            try:
                with completed():
                    if one.surface is not None and one.surface is not surface:
                        surface = one.surface
                        painter.begin(surface.first, surface.points_px, surface.model, session.fps)
                    painter.frame(one.frame, one.observation, one.estimate)
            except KeyboardInterrupt:
                session.interrupted = True
    return session.summary


def play(command: Retexture, painter: Painter, progress: Progress) -> Played:
    """Paint the frames of a recording.

    Raises:
        UsageError: it cannot be read, has no model or no pictures, or an option does not go with it.
    """
    drawn = {"--roi": command.roi, "--polygon": command.polygon, "--corners": command.corners}
    live = {**drawn, "--mask": command.mask, "--rrd": command.rrd, "--view": command.view or None}
    for option in (name for name, value in live.items() if value is not None):
        raise UsageError(f"{option} is for videos, not for the recording {command.source}: leave it out")
    playback = Playback.load(Path(command.source))
    model = playback.model
    for note in playback.notes:
        progress.log(note)
    first, stop = parse_range(command.frames)
    wanted = (playback.frames >= first) & (playback.frames < (stop or np.inf))
    if not wanted.any():
        numbers = f"{playback.frames[0]} to {playback.frames[-1]}"
        raise UsageError(f"{playback.path} has no frame in {command.frames}: it contains the frames {numbers}")
    outline = playback.configuration.get("corners") or playback.configuration.get("polygon")
    known = replace(painter.placement, outline=outline_of(cast("list[float] | None", outline)))
    painter.placement = placed(command, playback, known)
    begun = interrupted = False
    with progress:
        progress.expect(int(wanted.sum()))
        try:
            for i, image in playback.images():
                number = int(playback.frames[i])
                if stop is not None and number >= stop:
                    break
                if image is None:
                    continue
                frame = Frame(number, float(playback.times_s[i]), image)
                if not begun:
                    still = Frame(number, frame.time_s, first_frame(playback, i, image))
                    painter.begin(still, playback.texture_px, model, usual_fps(playback.times_s))
                    begun = True
                if number < first:
                    continue
                painter.frame(frame, Observation(playback.W[i].T, playback.visible[i]), playback.estimate(i))
                progress.advance("painting")
        except KeyboardInterrupt:
            interrupted = True
    if not begun:
        raise UsageError(f"{playback.path} contains no pictures: run again with --image jpeg or --image video")
    return Played(command.source, len(playback.frames), interrupted)


def placed(command: Retexture, playback: Playback, placement: Placement) -> Placement:
    """Where the picture lies in the first frame, if it has been told in another.

    Raises:
        UsageError: that frame is not there, or without a shape.
    """
    number = command.place_frame
    if number is None or placement.corners is None:
        return placement
    i = int(np.searchsorted(playback.frames, number))
    estimate = playback.estimate(i) if i < len(playback.frames) and playback.frames[i] == number else None
    if estimate is None:
        raise UsageError(f"--place-frame {number}: there is no shape in that frame; choose another one")
    at = (estimate.projection_px, estimate.shape[2], playback.W[i].T)
    perspective = playback.camera.perspective
    return in_first_frame(placement, at, playback.texture_px, playback.mesh, playback.size, perspective=perspective)


def first_frame(playback: Playback, i: int, image: Image) -> Image:
    """The frame (H, W, 3) in which the vertices are at `texture_px`, right where the surface is.

    The mesh's texture is a crop of it. The rest is in the recording's first `image`, of row i, or nowhere if the
    recording is a later part of a long one. Where `run --texture` has painted the crop, that image is all of it.

    Raises:
        UsageError: the surface is elsewhere in that image.
    """
    moved = np.linalg.norm(playback.W[i].T - playback.texture_px, axis=1)[playback.visible[i]]
    still = len(moved) > 0 and np.median(moved) <= STILL_PX
    if playback.configuration.get("texture") is None:
        (width, height), (x, y), (h, w) = playback.size, playback.texture_origin.tolist(), playback.texture_bgr.shape[:2]
        border = (y, height - y - h, x, width - x - w)
        around = image.copy() if still else cv2.copyMakeBorder(playback.texture_bgr, *border, cv2.BORDER_REPLICATE)
        around[y : y + h, x : x + w] = playback.texture_bgr
        return cast(Image, around)
    if not still:
        raise UsageError(f"{playback.path} begins later than its run: give the first part of the recording")
    return image


def is_recording(source: str) -> bool:
    """Whether a source is a recording, or is said to be one by its name."""
    path = Path(source)
    if path.suffix.lower() == ".rrd":
        return True
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(RRD_MAGIC)) == RRD_MAGIC
