"""A few keyframes of a whole video: those whose images differ most, chosen while it runs, in bounded memory."""

from collections.abc import Iterable

import numpy as np

from reconstruction import ReconstructionError
from reconstruction.arrays import Array, Indices, Mask

KEYFRAMES = 30
FEWEST_SHARED = 12  # points that two frames must share to be compared
FEWEST_SEEN = 0.25  # of the points that another frame showed it must show
SWEEPS = 3  # of re-weighting, against gross errors
TINY = 1e-12  # squared difference, relative, that counts as none
ENOUGH = 1000  # points to compare by


class Keyframes:
    """Keeps at most so many frames, spread by image configuration: farthest points on-line, by merging the nearest pair.

    A frame whose nearest keyframe is nearer than the nearest two keyframes are to each other is not taken; else it is,
    and when there are too many the newer of the nearest two goes. Distances are in units of the image's RMS radius,
    so that nothing depends on units.

    Args:
        capacity: most frames kept.

    Attributes:
        frames: their numbers, ascending.
        version: grows with every frame taken.
    """

    def __init__(self, capacity: int = KEYFRAMES) -> None:
        self.capacity = capacity
        self.frames: list[int] = []
        self.version = 0
        self._W: list[Array] = []
        self._visible: list[Mask] = []
        self._apart = np.zeros((0, 0))
        self._most = 0  # points that any frame offered showed
        self._alike = 0  # place of the keyframe most like the last frame that was compared with all

    @property
    def extent(self) -> float:
        """How far the two that differ most are apart; 0 with fewer than two."""
        return float(self._apart[np.isfinite(self._apart)].max(initial=0.0))

    def offer(self, frame: int, W: Array, visible: Mask) -> bool:
        """Take a frame's points (2, p) px with visibility (p,), if they differ from those there are; whether it was."""
        seen = int(visible.sum())
        self._most = max(self._most, seen)
        if seen < max(FEWEST_SHARED, FEWEST_SEEN * self._most):
            return False
        W, n = np.where(visible, W, 0.0), len(self.frames)
        least = nearest_pair(self._apart)[2] if n >= self.capacity else -1.0
        alike = slice(self._alike, self._alike + 1)
        if n >= self.capacity and self.differences(W, visible, alike)[0] <= least:  # as nearly always
            return False
        apart = self.differences(W, visible)
        self._alike = int(apart.argmin()) if n else 0
        if n >= self.capacity and apart[self._alike] <= least:
            return False
        grown = np.zeros((n + 1, n + 1))
        grown[:n, :n], grown[n, :n], grown[:n, n] = self._apart, apart, apart
        self._apart = grown
        self.frames.append(frame)
        self._W.append(W)
        self._visible.append(visible.copy())
        self.version += 1
        if len(self.frames) > self.capacity:
            self._drop(nearest_pair(self._apart)[1])
        return True

    def differences(self, W: Array, visible: Mask, which: slice = slice(None)) -> Array:
        """How much an image (2, p) differs from each keyframe, or some, see `difference`."""
        if not self._W:
            return np.zeros(0)
        return difference(W, visible, np.stack(self._W[which]), np.stack(self._visible[which]))

    def spread(self, count: int | None = None) -> tuple[Array, Mask, Indices]:
        """Points (F, 2, p) px, NaN where not visible, visibility (F, p) and numbers (F,), most different ones first."""
        order = farthest_first(self._apart, count or len(self.frames))
        W, visible = np.stack(self._W)[order], np.stack(self._visible)[order]
        return np.where(visible[:, None], W, np.nan), visible, np.array(self.frames, np.int64)[order]

    def _drop(self, k: int) -> None:
        del self.frames[k], self._W[k], self._visible[k]
        self._apart = np.delete(np.delete(self._apart, k, axis=0), k, axis=1)


def spread_of(frames: Iterable[tuple[Array, Mask]], capacity: int) -> tuple[Array, Mask, Indices]:
    """So many keyframes of frames, points (2, p) px and visible (p,), as `Keyframes.spread` gives them.

    Raises:
        ReconstructionError: no frame shows enough points.
    """
    keyframes = Keyframes(capacity)
    for number, (W, visible) in enumerate(frames):
        keyframes.offer(number, W, visible)
    if not keyframes.frames:
        raise ReconstructionError(f"no frame shows {FEWEST_SHARED} points")
    return keyframes.spread()


def difference(W: Array, visible: Mask, others: Array, others_visible: Mask) -> Array:
    """Robust RMS difference (F,) of an image (2, p) from others (F, 2, p) beyond a shift, over the image's RMS radius.

    Infinite where they share too few points.
    """
    both = (others_visible & visible).astype(np.float32)
    size = max(float(np.sqrt(np.var(W[:, visible], axis=1).sum())), 1e-300)
    moved = ((W - others) / size).astype(np.float32) * both[:, None]  # half the memory, in half the time
    h = both
    for _ in range(SWEEPS):
        total = np.maximum(h.sum(axis=1), 1e-12)
        off = moved - (moved @ h[:, :, None]) / total[:, None, None]
        squared = (off**2).sum(axis=1)
        usual = (h * squared).sum(axis=1) / total
        h = both / (1 + squared / (9 * usual[:, None] + TINY)) ** 2
    apart = np.sqrt((h * squared).sum(axis=1, dtype=np.float64) / np.maximum(h.sum(axis=1), 1e-12))
    return np.where(both.sum(axis=1) >= FEWEST_SHARED, apart, np.inf)


def thinned(points: int) -> Indices:
    """Some of so many points, at most `ENOUGH`, ascending: more tell no more. At random: they may lie in rows."""
    return np.sort(np.random.default_rng(0).choice(points, min(points, ENOUGH), replace=False))


def nearest_pair(apart: Array) -> tuple[int, int, float]:
    """The two nearest of things so far apart (F, F), the newer second, and their distance; infinite if there are none."""
    if len(apart) < 2:
        return 0, 0, np.inf
    i, j = np.triu_indices(len(apart), 1)
    k = int(apart[i, j].argmin())
    return int(i[k]), int(j[k]), float(apart[i[k], j[k]])


def farthest_first(apart: Array, count: int) -> Indices:
    """Order of things so far apart (F, F): the one farthest from all others, then always the farthest from those before."""
    finite = np.minimum(apart, 10 * apart[np.isfinite(apart)].max(initial=1e-12))
    order = [int(finite.sum(axis=1).argmax())]
    near = finite[order[0]].copy()
    near[order[0]] = -1.0
    while len(order) < min(count, len(apart)):
        k = int(near.argmax())
        order.append(k)
        near = np.minimum(near, finite[k])
        near[k] = -1.0
    return np.array(order)
