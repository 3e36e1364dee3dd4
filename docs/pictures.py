"""Makes the picture of the viewer in the README from recordings/demo.rrd: `make pictures`."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.viewer.conftest import Viewer, headless_viewer
from tests.viewer.screenshot import steady

Image = NDArray[np.uint8]

RECORDING = Path("recordings/demo.rrd")
FOLDER = Path(__file__).parent
WINDOW = (1280, 800)
TITLE_BAR_PX = 37  # of the viewer's window
SHRINK = 0.8
VIEWER_FRAME = 208  # the sheet is bent, and the hand on it


def photographed(viewer: Viewer, recording: Path, frame: int) -> Image:
    """The viewer's window with a frame of a recording."""
    viewer.client.open(str(recording.resolve()))
    while not viewer.client.get_state().recordings or viewer.client.get_state().loading:
        time.sleep(0.2)
    viewer.client.set_time("frame", sequence=frame, play_state="paused")
    return steady(viewer)[TITLE_BAR_PX:]


def save(name: str, image: Image) -> None:
    """Write a picture, a little smaller."""
    small = cv2.resize(image, None, fx=SHRINK, fy=SHRINK, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(FOLDER / name), small, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def main() -> None:
    """Write it."""
    with TemporaryDirectory() as folder, headless_viewer(Path(folder), WINDOW) as viewer:
        save("viewer.png", photographed(viewer, RECORDING, VIEWER_FRAME))


if __name__ == "__main__":
    main()
