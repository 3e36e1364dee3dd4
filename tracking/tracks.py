"""Tracked points of a whole sequence, and the truth some sequences come with."""

from dataclasses import dataclass, replace
from typing import Any, BinaryIO, Self

import numpy as np
from numpy.typing import NDArray

from tracking import Array, Flags, Indices, TrackingError
from tracking.extent import LARGEST

FEWEST_KNOWN = 3  # points of a true shape: fewer can always be turned and placed
SKEW = 1e-3  # of the focal length: more is no ordinary camera


@dataclass(frozen=True)
class Tracks:
    """Image points of F frames and P points; where not visible, `W` may hold anything.

    Attributes:
        W: (F, 2, P) image points, px.
        visible: (F, P) bool.
        K: (3, 3) camera intrinsics, if known.
        S_gt: (K, 3, P) true shapes in camera axes (x right, y down, z forward), if known; NaN for points that are not.
        gt_frames: (K,) the frame each true shape belongs to, ascending; given together with S_gt.
        note: what people should know of them.

    Raises:
        TrackingError: shapes that do not fit, or entries that are not finite.
    """

    W: Array
    visible: Flags
    K: Array | None = None
    S_gt: Array | None = None
    gt_frames: Indices | None = None
    note: str = ""

    def __post_init__(self) -> None:
        if self.W.ndim != 3 or self.W.shape[1] != 2 or 0 in self.W.shape:
            raise _wrong_shape("W", self.W, "(frames, 2, points)")
        frames, _, points = self.W.shape
        if self.visible.shape != (frames, points):
            raise _wrong_shape("visible", self.visible, f"({frames}, {points}) as in W")
        bad = self.visible & ~np.isfinite(self.W).all(axis=1)
        if bad.any():
            f, p = np.argwhere(bad)[0]
            raise TrackingError(
                f"W has {int(bad.sum())} visible entries that are not finite (first: frame {f}, point {p}); "
                "mark them as not visible"
            )
        _check_intrinsics(self.K)
        if (self.S_gt is None) != (self.gt_frames is None):
            raise TrackingError("S_gt and gt_frames belong together; only one of them is given")
        if self.S_gt is not None and self.gt_frames is not None:
            _check_truth(self.S_gt, self.gt_frames, points)
            if self.gt_frames[-1] >= frames:
                raise TrackingError(f"gt_frames goes to {self.gt_frames[-1]}, but W has only the frames 0 to {frames - 1}")

    def with_square_pixels(self) -> Self:
        """The same with both focal lengths of K equal: y as long as x."""
        if self.K is None or self.K[0, 0] == self.K[1, 1]:
            return self
        W, K = self.W.copy(), self.K.copy()
        W[:, 1] = K[1, 2] + K[0, 0] / K[1, 1] * (W[:, 1] - K[1, 2])
        K[1, 1] = K[0, 0]
        return replace(self, W=W, K=K)

    def of_points(self, kept: Flags) -> Self:
        """The same of some of the points (P,) alone."""
        S_gt = None if self.S_gt is None else self.S_gt[:, :, kept]
        return replace(self, W=self.W[:, :, kept], visible=self.visible[:, kept], S_gt=S_gt)

    def save(self, file: BinaryIO) -> None:
        """Write it into a file that is open, as .npz."""
        optional = {"K": self.K, "S_gt": self.S_gt, "gt_frames": self.gt_frames}
        arrays: dict[str, Any] = {name: value for name, value in optional.items() if value is not None}
        np.savez_compressed(file, W=self.W, visible=self.visible, **arrays)


@dataclass(frozen=True)
class Truth:
    """True shapes of some frames, with the pixels their points are seen at.

    Attributes:
        W_px: (K, 2, P) pixel positions.
        S: (K, 3, P) true shapes in camera axes (x right, y down, z forward), any unit; NaN for points not known.
        frames: (K,) the frame each belongs to, ascending.
        K: (3, 3) camera intrinsics, if known.
    """

    W_px: Array
    S: Array
    frames: Indices
    K: Array | None = None

    def __post_init__(self) -> None:
        if self.W_px.ndim != 3 or self.W_px.shape[1] != 2 or 0 in self.W_px.shape:
            raise _wrong_shape("W_px", self.W_px, "(true frames, 2, points)")
        _check_truth(self.S, self.frames, self.W_px.shape[2])
        if self.W_px.shape[0] != self.S.shape[0]:
            raise _wrong_shape("W_px", self.W_px, f"({self.S.shape[0]}, 2, {self.S.shape[2]}) as in S_gt")
        if not np.isfinite(self.W_px).all():
            raise TrackingError("W_px has entries that are not finite")
        _check_intrinsics(self.K)


def _check_intrinsics(K: Array | None) -> None:
    if K is None:
        return
    if K.shape != (3, 3):
        raise _wrong_shape("K", K, "(3, 3)")
    if not (np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0):
        raise TrackingError("K is no camera matrix; its focal lengths K[0, 0] and K[1, 1] must be positive")
    if abs(K[1, 0]) + abs(K[0, 1]) > SKEW * K[0, 0] or not np.allclose(K[2], (0, 0, 1)):
        raise TrackingError("K is no camera matrix without skew; it must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")


def known_points(S: Array) -> Flags:
    """Which points (K, P) of true shapes (K, 3, P) are known."""
    return np.asarray(np.isfinite(S).all(axis=1))


def _check_truth(S: Array, frames: Indices, points: int) -> None:
    if S.ndim != 3 or S.shape[1:] != (3, points) or len(S) == 0:
        raise _wrong_shape("S_gt", S, f"(true frames, 3, {points}) as there are {points} points")
    if np.isinf(S).any():
        raise TrackingError("S_gt has infinite entries; NaN tells that a point is not known")
    few = known_points(S).sum(axis=1) < FEWEST_KNOWN
    if few.any():
        raise TrackingError(f"S_gt knows fewer than {FEWEST_KNOWN} points of its shape {np.argmax(few)}: leave it out")
    if np.nanmax(np.abs(S)) > LARGEST:
        raise TrackingError(f"S_gt has values beyond {LARGEST:g}")
    if frames.shape != (len(S),):
        raise _wrong_shape("gt_frames", frames, f"({len(S)},) as S_gt has {len(S)} shapes")
    still = (np.nanmax(S, axis=2) - np.nanmin(S, axis=2)).max(axis=1) < 1 / LARGEST
    if still.any():
        raise TrackingError(f"S_gt has a shape without extent: that of frame {frames[still][0]}")
    if frames[0] < 0 or np.any(np.diff(frames) <= 0):
        raise TrackingError("gt_frames must ascend from 0 or later, each frame once")


def _wrong_shape(name: str, array: NDArray[Any], asked: str) -> TrackingError:
    return TrackingError(f"{name} has the shape {array.shape}, but {asked} is needed")
