"""The search for the surface in the first frames: points of the whole region are followed until enough has moved."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tracking import Array, Image, TrackingError
from tracking.features import detect_corners
from tracking.flow import CONVERGED_PX, GUIDE_LEVELS, Grays, lucas_kanade, returned
from tracking.region.surface import Surface, surfaces
from tracking.video import Frame

MOST_FRAMES = 90  # are looked at
ENOUGH = 0.05  # of the picture's larger side: when the farthest tenth has moved so far, that is enough
TENTH = 0.9
COMPARED = 20  # of those frames that are compared
WINDOW_PX = 15
FEWEST, POINTS = 50, 800
LEFT_OUT = 0.03  # of the points: when no more are of something else, a region stays as it was given
BLANK_FRAMES = 300  # without texture at the beginning, and no more are waited for


@dataclass(frozen=True)
class Found:
    """What the first frames show.

    Attributes:
        first: the first frame with texture.
        region: (H, W) uint8, 255 where points are to be detected in that frame.
        surface: what moves most; None in a still scene.
        others: what else moves, best first.
        frames: how many were looked at.
        narrowed: whether the region is smaller than it was.
    """

    first: Frame
    region: Image
    surface: Surface | None
    others: list[Surface]
    frames: int
    narrowed: bool


class Search:
    """Follows points of a region from its first frame on.

    Args:
        image_bgr: that frame, (H, W, 3) uint8.
        region: (H, W) uint8, 255 where to look.

    Attributes:
        frames: looked at so far.

    Raises:
        TrackingError: too few corners.
    """

    def __init__(self, image_bgr: Image, region: Image) -> None:
        self._region, self._grays = region, Grays.of(image_bgr)
        # Points nearer to each other are seen by the same windows: their motion blurs across borders.
        most = int(np.clip(np.count_nonzero(region) // WINDOW_PX**2, FEWEST, POINTS))
        self._tracks = [detect_corners(self._grays.full, region, most)]
        self._way = np.zeros(len(self._tracks[0]))  # of each point so far, at most

    @property
    def frames(self) -> int:
        """Looked at so far."""
        return len(self._tracks)

    @property
    def enough(self) -> bool:
        """Whether further frames would not tell more."""
        return self.frames >= MOST_FRAMES or float(np.quantile(self._way, TENTH)) > ENOUGH * max(self._region.shape)

    def add(self, image_bgr: Image) -> None:
        """Look at the next frame."""
        before, self._grays, last = self._grays.full, Grays.of(image_bgr), self._tracks[-1]
        now, moved = self._grays.full, np.full_like(last, np.nan)
        seen = np.flatnonzero(np.isfinite(last[:, 0]))
        if len(seen):
            start, levels = last[seen], GUIDE_LEVELS + 1 + max(0, round(np.log2(max(now.shape) / 640.0)))
            still = np.zeros_like(start)  # no guides: what has no texture would go where they go
            there, good = lucas_kanade(before, now, start, still, WINDOW_PX, levels, CONVERGED_PX)
            good &= returned(before, now, start, there, still, WINDOW_PX, levels)
            moved[seen[good]] = there[good]
        self._tracks.append(moved)
        self._way = np.fmax(self._way, np.linalg.norm(moved - self._tracks[0], axis=1))

    def surfaces(self) -> list[Surface]:
        """What moves, by the frames so far, the best first."""
        return surfaces(self._compared(), self._region)

    def _compared(self) -> Array:
        """Tracks (F, P, 2) in well-spread frames."""
        chosen = np.unique(np.linspace(0, self.frames - 1, COMPARED).round().astype(int))
        return np.stack([self._tracks[k] for k in chosen])


def search(frames: Iterable[Frame], region: Image) -> Found:
    """Look for the surface in a region (H, W) uint8 of the first frames, past those without texture.

    Raises:
        TrackingError: no frame has enough corners.
    """
    begun: Search | None = None
    blank = TrackingError("there is no frame")
    first: Frame | None = None
    for waited, frame in enumerate(frames):
        if begun is None or first is None:
            try:
                begun, first = Search(frame.image, region), frame
            except TrackingError as error:
                blank = error
                if waited >= BLANK_FRAMES:
                    raise
            continue
        begun.add(frame.image)
        if begun.enough:
            break
    if begun is None or first is None:
        raise blank
    moving = begun.surfaces()
    if not moving:
        return Found(first, region, None, [], begun.frames, narrowed=False)
    best = moving[0]
    left_out = ~best.own if region.all() else best.other  # nobody has chosen a picture's corners
    narrowed = float(left_out.mean()) > LEFT_OUT
    return Found(first, best.mask if narrowed else region, best, moving[1:], begun.frames, narrowed)
