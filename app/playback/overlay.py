"""Frames of a recording with what was tracked and reconstructed drawn over them."""

from collections import deque
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from app.arrays import Array, Image
from app.playback.playback import Playback
from app.recording.styles import LOST_RGB, PREDICTED_RGB, SEEN_RGB
from app.terminal.errors import UsageError

Color = tuple[int, int, int]

TRAIL_FRAMES = 8
ERROR_RGB = (255, 255, 255)
MESH_RGB = (30, 120, 255)  # deeper than in the viewer: it has to show on white paper, too
FADED = 110  # of 255
MESH_OPACITY, TRAIL_OPACITY = 0.55, 0.8
SMALLEST_SIDE_PX = 720  # smaller pictures are enlarged: thin lines need room
SUBPIXEL_BITS = 4
FONT = cv2.FONT_HERSHEY_SIMPLEX


def overlaid(playback: Playback) -> Iterator[tuple[int, Image]]:
    """Row and picture of every frame that has one.

    Drawn over it: the mesh where the model puts it, the points that are seen, predicted or lost in the viewer's colors
    with the way they came, and lines from the points to their reprojections. Pictures have the size that `enlarged` says.

    Raises:
        UsageError: the recording has no pictures, or no model.
    """
    edges, drawn = playback.mesh.edges, playback.mesh.vertices
    size = enlarged(playback.size)
    a, b = playback.texture_px[edges].transpose(1, 0, 2)
    apart = float(np.median(np.linalg.norm(a - b, axis=1))) * size[0] / playback.size[0]
    last_seen = np.full((playback.W.shape[2], 2), np.nan)
    trail: deque[Array] = deque(maxlen=TRAIL_FRAMES)
    some = False
    for i, image in playback.images():
        observed, visible = playback.W[i].T, playback.visible[i]
        last_seen = np.where(visible[:, None], observed, last_seen)
        estimate = playback.estimate(i)
        trail.append(np.where(visible[:, None], observed, np.nan))
        if image is None:
            continue
        some = True
        canvas = Canvas(image, size, float(np.clip(0.14 * apart, 1.2, 2.0)))
        canvas.trails(list(trail), SEEN_RGB)
        missing = last_seen[~visible]
        words = [("seen", int(visible.sum()), SEEN_RGB)]
        if estimate is not None:
            projected = estimate.projection_px
            canvas.lines(projected[edges], MESH_RGB, MESH_OPACITY)
            canvas.lines(np.stack([observed, projected], axis=1)[visible], ERROR_RGB)
            canvas.points(projected[drawn[~visible[drawn]]], PREDICTED_RGB)
            words.append(("predicted", int((~visible[drawn]).sum()), PREDICTED_RGB))
        else:
            canvas.points(missing, LOST_RGB)
            words.append(("lost", int((~visible).sum()), LOST_RGB))
        canvas.points(observed[visible], SEEN_RGB)
        title = f"frame {playback.frames[i]}   {playback.times_s[i]:.2f} s"
        if estimate is not None and visible.any():
            title += f"   error {np.sqrt(np.nanmean(estimate.residual_px**2)):.2f} px"
        canvas.caption(title, words)
        yield i, canvas.image
    if not some:
        raise UsageError(f"{playback.path} has no pictures: run again with --image jpeg")


def enlarged(size: tuple[int, int]) -> tuple[int, int]:
    """Size (width, height) of the overlays of frames of some size; even, as video codecs want it."""
    scale = max(1.0, np.ceil(2 * SMALLEST_SIDE_PX / min(size)) / 2)
    width, height = (int(side * scale) // 2 * 2 for side in size)
    return width, height


class Canvas:
    """A picture (H, W, 3) BGR to draw on, enlarged to `size` with dots of radius `dot_px`; coordinates are the original's.

    Attributes:
        image: the picture.
    """

    def __init__(self, image: Image, size: tuple[int, int], dot_px: float = 1.8) -> None:
        self._scale = np.array(size) / image.shape[1::-1]
        self._unit = max(1.0, min(size) / SMALLEST_SIDE_PX)  # of lines and text
        self._dot_px = dot_px * self._unit
        self.image: Image = cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)  # type: ignore[assignment]

    def lines(self, segments: Array, color: Color, opacity: float = 1.0) -> None:
        """Lines (n, k, 2) through k points each; those with an unknown point are left out."""
        if opacity == 1:
            self._strokes(self.image, segments, color[::-1])
            return
        mask = np.zeros(self.image.shape[:2], np.uint8)
        self._strokes(mask, segments, 255)
        self._blend(mask, color, opacity)

    def trails(self, places: list[Array], color: Color) -> None:
        """The way points came: places (n, 2) in earlier frames, the newest last; the older half is faded."""
        mask = np.zeros(self.image.shape[:2], np.uint8)
        way, middle = np.stack(places, axis=1), max(0, len(places) - 1 - TRAIL_FRAMES // 2)
        for part, value in ((way[:, : middle + 1], FADED), (way[:, middle:], 255)):
            if part.shape[1] > 1:
                self._strokes(mask, part, value)
        self._blend(mask, color, TRAIL_OPACITY)

    def points(self, places: Array, color: Color) -> None:
        """Dots at places (n, 2), with a dark rim so that they show on every ground."""
        fixed = self._fixed(places[np.isfinite(places).all(axis=1)])
        # Lines from each place to itself have round ends: all dots are drawn in one call.
        dots = list(np.stack([fixed, fixed], axis=1))
        for radius, paint in ((1.45 * self._dot_px, (28, 24, 20)), (self._dot_px, color[::-1])):
            cv2.polylines(self.image, dots, False, paint, max(1, round(2 * radius)), cv2.LINE_AA, SUBPIXEL_BITS)

    def caption(self, title: str, counts: list[tuple[str, int, Color]]) -> None:
        """A line of text on a dimmed strip at the bottom, with colored dots as the key."""
        size, unit = 0.5 * self._unit, self._unit
        height = round(28 * unit)
        strip = self.image[-height:]
        cv2.convertScaleAbs(strip, strip, alpha=0.35)
        base = self.image.shape[0] - round(9 * unit)
        x = round(12 * unit)

        def write(text: str) -> None:
            nonlocal x
            cv2.putText(self.image, text, (x, base), FONT, size, (235, 235, 235), max(1, round(unit)), cv2.LINE_AA)
            x += cv2.getTextSize(text, FONT, size, max(1, round(unit)))[0][0]

        write(title)
        for name, count, color in counts:
            x += round(26 * unit)
            cv2.circle(self.image, (x, base - round(5 * unit)), round(4 * unit), color[::-1], cv2.FILLED, cv2.LINE_AA)
            x += round(10 * unit)
            write(f"{name} {count}")

    def _fixed(self, places: Array) -> NDArray[np.int32]:
        """Places in the enlarged picture as OpenCV's fixed-point numbers; pixel centres are whole numbers in both."""
        scaled = (places + 0.5) * self._scale - 0.5
        return np.asarray(np.round(np.clip(scaled, -1e4, 1e5) * 2**SUBPIXEL_BITS), np.int32)

    def _strokes(self, mask: Image, segments: Array, value: int | Color) -> None:
        known = segments[np.isfinite(segments).all(axis=(1, 2))]
        width = max(1, round(self._unit))
        paint = (value,) if isinstance(value, int) else value
        cv2.polylines(mask, list(self._fixed(known)), False, paint, width, cv2.LINE_AA, SUBPIXEL_BITS)

    def _blend(self, mask: Image, color: Color, opacity: float) -> None:
        x, y, w, h = cv2.boundingRect(mask)
        if not w:
            return
        part, inked = self.image[y : y + h, x : x + w], mask[y : y + h, x : x + w]
        # In bytes: several times as fast as with shares as numbers.
        rest = cv2.convertScaleAbs(inked, alpha=-opacity, beta=255)
        paint = [cv2.convertScaleAbs(inked, alpha=opacity * level / 255) for level in color[::-1]]
        kept = cv2.multiply(part, cv2.merge([rest] * 3), scale=1 / 255)
        self.image[y : y + h, x : x + w] = cv2.add(kept, cv2.merge(paint))
