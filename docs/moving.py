"""Makes the moving picture of the README, docs/retexture.webp, from recordings/demo.rrd: `make pictures`."""

from pathlib import Path

import cv2
import numpy as np
from PIL import Image as Pictures

from app.painting.compositing import Compositor
from app.painting.picture import premultiplied
from app.playback.playback import Playback
from docs.pictures import RECORDING, Image

OUT = Path(__file__).parent / "retexture.webp"
CROP = np.s_[85:385, 105:535]  # of the sample's frames
FRAMES = slice(96, 240, 4)  # the sheet waves, then a hand comes and goes
WIDTH = 300
STEP_MS = 133
QUALITY = 45
MOST_BYTES = 600_000


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


def painted(playback: Playback) -> list[Image]:
    """Frames as they were beside them with the picture on the sheet, BGR."""
    shown: list[Image] = []
    work, picture = None, premultiplied(poster())
    for i, image in playback.images():
        estimate = playback.estimate(i)
        assert image is not None
        assert estimate is not None
        work = work or Compositor(image, playback.texture_px, playback.mesh, perspective=True)
        new = work.paint(image, picture, estimate.projection_px, estimate.shape[2], playback.W[i].T)
        if i in range(*FRAMES.indices(len(playback.frames))):
            pair = [np.ascontiguousarray(seen[CROP]) for seen in (image, new)]
            height = round(WIDTH * pair[0].shape[0] / pair[0].shape[1])
            shown.append(np.hstack([cv2.resize(p, (WIDTH, height), interpolation=cv2.INTER_AREA) for p in pair]))
    return shown


def main() -> None:
    """Write it."""
    frames = [Pictures.fromarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB)) for image in painted(Playback.load(RECORDING))]
    frames[0].save(
        OUT,
        save_all=True,
        append_images=frames[1:],
        duration=STEP_MS,
        loop=0,
        quality=QUALITY,
        method=6,
        minimize_size=True,
    )
    assert OUT.stat().st_size <= MOST_BYTES, OUT.stat().st_size


if __name__ == "__main__":
    main()
