"""One way in which footage is degraded, and the copy that it makes of a clip."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

import cv2
import numpy as np

from app.arrays import Array, Image
from app.footage.camera import Turn, homography, steady
from app.footage.clip import Change, Clip, Region
from app.footage.storage import Storage

FILL = (90, 90, 90)  # what a turned camera sees beyond the picture


@dataclass(frozen=True)
class Case:
    """What is done to a clip.

    Attributes:
        name: what it is called, in words.
        wanted: e3d at most, %; None where the word is to be "poor".
        changes: of its pictures, one after the other.
        turn: of its camera.
        phase, every: the first of its frames that is left, and how many frames on the next one is.
        before: pictures that come first, by the size.
        stretch: factors of the pixels along x and y.
        mirrored: whether left and right change places.
        loose: by how much the region is larger than the surface, as a share of its sides; None where nobody tells it.
        storage: how it is written.
    """

    name: str
    wanted: float | None
    changes: tuple[Change, ...] = ()
    turn: Turn = steady
    phase: int = 0
    every: int = 1
    before: Callable[[tuple[int, int]], list[Image]] = lambda _: []
    stretch: tuple[float, float] = (1.0, 1.0)
    mirrored: bool = False
    loose: float | None = 0.0
    storage: Storage = field(default_factory=Storage)


@dataclass(frozen=True)
class Copy:
    """A degraded copy: what it is read from, its truth, and where the surface is in its first frame, if that is told."""

    source: str
    truth: Path
    roi: Region | None


def write(clip: Clip, case: Case, folder: Path) -> Copy:
    """The copy that a case makes of a clip, in a folder."""
    turned = Turned(clip, case)
    before = case.before(turned.size)
    kept = list(range(case.phase, clip.frames, case.every))
    source = case.storage.write(folder, chain(before, turned.pictures(kept)))
    known, number = clip.known, {frame: k + len(before) for k, frame in enumerate(kept)}
    rows = [k for k, frame in enumerate(known.frames) if int(frame) in number]
    # Pixels that are not square are shown square: a player makes them so, and so are those of the truth.
    shown = Turned(clip, case, aspect=float(case.storage.pixel_aspect))
    np.savez(
        folder / "truth.npz",
        W_px=np.stack([shown.points(int(known.frames[k]), known.W_px[k]) for k in rows]),
        S_gt=np.stack([shown.axes(int(known.frames[k])) @ known.S[k] for k in rows]),
        gt_frames=[number[int(known.frames[k])] for k in rows],
        K=shown.K,
    )
    return Copy(source, folder / "truth.npz", None if case.loose is None else shown.region(case.loose))


class Turned:
    """A clip as another camera shows it.

    Args:
        clip: the clip.
        case: how the camera differs.
        aspect: of its pixels as they are shown.
    """

    def __init__(self, clip: Clip, case: Case, aspect: float = 1.0) -> None:
        self._clip, self._case = clip, case
        self._stretch = (case.stretch[0] * aspect, case.stretch[1])
        width, height = clip.size
        self.size = (round(width * self._stretch[0] / 2) * 2, round(height * self._stretch[1] / 2) * 2)

    @property
    def K(self) -> Array:
        """Intrinsics (3, 3)."""
        return self._maps(np.eye(3))[1]

    def pictures(self, frames: list[int]) -> Iterator[Image]:
        """Some of the clip's frames."""
        wanted = set(frames)
        for frame, image in enumerate(self._clip.pictures()):
            if frame not in wanted:
                continue
            for change in self._case.changes:
                image = change(self._clip, frame, image)
            H = self._maps(self._case.turn(self._clip, frame))[0]
            if not np.allclose(H, np.eye(3)):
                enlarged = cv2.INTER_CUBIC if min(self._stretch) >= 1 else cv2.INTER_AREA
                image = np.asarray(cv2.warpPerspective(image, H, self.size, flags=enlarged, borderValue=FILL), np.uint8)
            yield image

    def points(self, frame: int, W_px: Array) -> Array:
        """Points (2, P) px of a frame."""
        moved = self._maps(self._case.turn(self._clip, frame))[0] @ np.vstack([W_px, np.ones(W_px.shape[1])])
        return np.asarray(moved[:2] / moved[2])

    def axes(self, frame: int) -> Array:
        """Its axes (3, 3) in a frame by those of the clip's camera."""
        return np.diag([-1.0 if self._case.mirrored else 1.0, 1.0, 1.0]) @ self._case.turn(self._clip, frame)

    def region(self, loose: float) -> Region:
        """Where the surface is in the first frame, sides longer by a share of them."""
        x, y, w, h = self._clip.roi
        corners = np.array([[x, x + w - 1, x + w - 1, x], [y, y, y + h - 1, y + h - 1]], np.float64)
        corners = self.points(self._case.phase, corners)
        low, high = corners.min(axis=1), corners.max(axis=1)
        margin = 0.5 * loose * (high - low)
        left, top = np.ceil(np.maximum(low - margin, 0)).astype(int)
        right, bottom = np.floor(np.minimum(high + margin, np.array(self.size) - 1)).astype(int)
        return int(left), int(top), int(right - left + 1), int(bottom - top + 1)

    def _maps(self, R: Array) -> tuple[Array, Array]:
        return homography(self._clip.K, R, self._stretch, self.size[0] if self._case.mirrored else None)
