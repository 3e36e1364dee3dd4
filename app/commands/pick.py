"""`modeshape pick`: a region drawn on a page; `modeshape frame`: a frame with a grid of pixels."""

import shlex
import webbrowser
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from app.arrays import Image
from app.files.writing import check_outputs, writable
from app.options.pick import FramePicture, Pick
from app.picking.pictures import Pictures
from app.picking.region import Picked
from app.picking.server import About, Picking
from app.terminal.arguments import words_of
from app.terminal.progress import Progress
from app.terminal.summary import Summary
from tracking.video import Video

LINE_BGR, TEXT_PX = (80, 220, 255), 11


@dataclass(frozen=True)
class Chosen(Summary):
    """What was drawn: the options, and the command they make."""

    source: str
    options: list[str]
    command: str

    def print_short(self) -> None:
        """The command alone, to be copied."""
        self.print_table()

    def print_table(self) -> None:
        """The command alone, to be copied."""
        import sys

        sys.stdout.write(f"{self.command}\n")


@dataclass(frozen=True)
class Framed(Summary):
    """The picture that was written."""

    source: str
    frame: int
    width: int
    height: int
    out: Path


def pick(command: Pick, progress: Progress) -> Summary:
    """Serve the page until somebody is done; with --run, the run's summary.

    Raises:
        UsageError, TrackingError: a source that cannot be read, or what stands in the way of the run.
    """
    more = words_of("--options", command.options)
    from app.commands.cli import parse

    parse(["run", command.source, *more])  # a mistake in them is told before anything is drawn

    def words(found: Picked) -> str:
        return shlex.join(["modeshape", "run", command.source, *found.options, *more])

    with ExitStack() as stack:
        pictures = stack.enter_context(Pictures(command.source, command.frame))
        about = About(command.source, pictures.frame_count, command.frame, pictures.live)
        page = stack.enter_context(Picking(about, pictures.jpeg, words, command.port))
        progress.log(f"draw the region at {page.url}")
        if command.open:
            webbrowser.open(page.url)
        found = page.wait()
    if not command.run:
        return Chosen(command.source, found.options, words(found))
    from app.commands.cli import parse
    from app.pipeline.session import Session

    progress.log(words(found))
    return Session(parse(["run", command.source, *found.options, *more]), progress).run()


def frame(command: FramePicture, _: Progress) -> Framed:
    """Write the frame.

    Raises:
        UsageError, TrackingError: a source that cannot be read, or a file that cannot be written.
    """
    check_outputs({"--out": command.out}, [Path(command.source)], overwrite=command.overwrite)
    with Video(command.source, command.number, command.number + 1) as video:
        picture = next(iter(video)).image
    height, width = picture.shape[:2]
    ending = command.out.suffix.lower()
    with writable(command.out) as file:
        file.write(cv2.imencode(ending, with_grid(picture, command.grid) if command.grid else picture)[1].tobytes())
    return Framed(command.source, command.number, width, height, command.out)


def with_grid(picture: Image, every: int) -> Image:
    """A picture with lines at multiples of so many pixels, half transparent, and their numbers along two sides."""
    height, width = picture.shape[:2]
    lines = picture.copy()
    for x in range(0, width, every):
        lines[:, x] = LINE_BGR
    for y in range(0, height, every):
        lines[y] = LINE_BGR
    drawn = np.asarray(cv2.addWeighted(picture, 0.55, lines, 0.45, 0.0), np.uint8)
    size = max(1.0, height / 480) * TEXT_PX / 22
    for x in range(every, width, every):
        label(drawn, str(x), (x + 2, round(22 * size)), size)
    for y in range(every, height, every):
        label(drawn, str(y), (2, y - 3), size)
    return drawn


def label(picture: Image, text: str, at: tuple[int, int], size: float) -> None:
    """Write on a picture, readable on anything."""
    for colour, width in (((0, 0, 0), 3), (LINE_BGR, 1)):
        cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, colour, width, cv2.LINE_AA)
