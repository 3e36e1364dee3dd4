"""A stretch of a video whose surface is known."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from app.arrays import Array, Image
from app.files.track_file import load_truth
from tracking.tracks import Truth
from tracking.video import Video

Region = tuple[int, int, int, int]  # x, y, width, height px


@dataclass(frozen=True)
class Clip:
    """The first frames of a video, its truth, and where the surface is in frame 0."""

    video: Path
    truth: Path
    roi: Region
    frames: int

    @cached_property
    def known(self) -> Truth:
        """The true shapes."""
        return load_truth(self.truth)

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height px."""
        with Video(str(self.video), 0, 1) as video:
            return video.size

    @property
    def K(self) -> Array:
        """Intrinsics (3, 3) of the camera."""
        assert self.known.K is not None
        return self.known.K

    def pictures(self) -> Iterator[Image]:
        """Its frames, (H, W, 3)."""
        with Video(str(self.video), 0, self.frames) as video:
            for frame in video:
                yield frame.image

    def surface(self, frame: int) -> Array:
        """The true points (P, 2) px in any frame, between the frames of the truth by straight lines."""
        frames, W = self.known.frames, self.known.W_px
        k = int(np.clip(np.searchsorted(frames, frame), 1, len(frames) - 1))
        share = np.clip((frame - frames[k - 1]) / (frames[k] - frames[k - 1]), 0.0, 1.0)
        return np.asarray(((1 - share) * W[k - 1] + share * W[k]).T)

    def mask(self, frame: int, margin_px: int = 0) -> Image:
        """Where the surface is, (H, W) 255 inside its convex hull and so far around it."""
        hull = cv2.convexHull(self.surface(frame).astype(np.float32).reshape(-1, 1, 2))
        mask = np.zeros(self.size[::-1], np.uint8)
        cv2.fillConvexPoly(mask, np.rint(hull).astype(np.int32), (255,))
        return np.asarray(cv2.dilate(mask, np.ones((2 * margin_px + 1, 2 * margin_px + 1), np.uint8)), np.uint8)


Change = Callable[[Clip, int, Image], Image]  # of a picture (H, W, 3), by its clip and the number of its frame
