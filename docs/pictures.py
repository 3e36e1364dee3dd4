"""Makes the pictures of the README from recordings/demo.rrd: `make pictures`."""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from numpy.typing import NDArray

from app.painting.compositing import Compositor
from app.painting.picture import premultiplied
from app.playback.playback import Playback
from tests.viewer.conftest import Viewer, headless_viewer
from tests.viewer.screenshot import steady

Image = NDArray[np.uint8]

RECORDING = Path("recordings/demo.rrd")
FOLDER = Path(__file__).parent
WINDOW = (1280, 800)
TITLE_BAR_PX = 37  # of the viewer's window
SHRINK = 0.8
HAND_FRAME = 214
WAVE_FRAME = 118
VIEWER_FRAME = 208  # the sheet is bent, and the hand on it
CROP = np.s_[85:385, 105:535]  # of the sample's frames


def poster() -> Image:
    """(h, w, 3) BGR the picture that is painted on the sheet: a plate that vibrates, with the program's name."""
    y, x = np.mgrid[:840, :1188].astype(np.float32)
    height = np.sin(3 * np.pi * x / 1188) * np.sin(2 * np.pi * y / 840)
    lines = np.abs(height * 6 - np.round(height * 6)) < 0.06
    colours = cv2.applyColorMap(np.clip(127.5 + 120 * height, 0, 255).astype(np.uint8), cv2.COLORMAP_TWILIGHT_SHIFTED)
    image = np.where(lines[..., None], 245, colours).astype(np.uint8)
    cv2.rectangle(image, (0, 0), (1187, 839), (245, 245, 245), 36)
    cv2.rectangle(image, (0, 350), (1187, 490), (245, 245, 245), cv2.FILLED)
    font, size, thick = cv2.FONT_HERSHEY_DUPLEX, 5.0, 8
    (wide, tall), _ = cv2.getTextSize("modeshape", font, size, thick)
    cv2.putText(image, "modeshape", ((1188 - wide) // 2, (840 + tall) // 2), font, size, (70, 30, 40), thick, cv2.LINE_AA)
    return image


def retextured(playback: Playback, frames: tuple[int, ...]) -> Image:
    """Frames as they were, and below them with the picture on the sheet."""
    pairs, work, picture = [], None, premultiplied(poster())
    for i, image in playback.images():
        estimate = playback.estimate(i)
        assert image is not None
        assert estimate is not None
        work = work or Compositor(image, playback.texture_px, playback.mesh, perspective=True)
        new = work.paint(image, picture, estimate.projection_px, estimate.shape[2], playback.W[i].T)
        if int(playback.frames[i]) in frames:
            pairs.append(np.vstack([image[CROP], new[CROP]]))
    return np.hstack(pairs)


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
    """Write both."""
    save("retexture.png", retextured(Playback.load(RECORDING), (WAVE_FRAME, HAND_FRAME)))
    with TemporaryDirectory() as folder, headless_viewer(Path(folder), WINDOW) as viewer:
        save("viewer.png", photographed(viewer, RECORDING, VIEWER_FRAME))


if __name__ == "__main__":
    main()
