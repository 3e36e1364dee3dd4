"""Tracked points of a whole sequence, and the truth some sequences come with, as .npz files."""

import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Self

import numpy as np
from numpy.typing import NDArray

from tracking import Array, Flags, Indices, TrackingError
from tracking.extent import LARGEST, check_extent

LARGEST_BYTES = 4 * 2**30  # of arrays in a file
ROWS = {"W": 2, "W_px": 2, "S_gt": 3}  # of a frame, in matrices (2F, P) and (3K, P) as the literature has them
SKEW = 1e-3  # of the focal length: more is no ordinary camera


@dataclass(frozen=True)
class Tracks:
    """Image points of F frames and P points; where not visible, `W` may hold anything.

    Attributes:
        W: (F, 2, P) image points, px.
        visible: (F, P) bool.
        K: (3, 3) camera intrinsics, if known.
        S_gt: (K, 3, P) true shapes in camera axes (x right, y down, z forward), if known.
        gt_frames: (K,) the frame each true shape belongs to, ascending; given together with S_gt.

    Raises:
        TrackingError: shapes that do not fit, or entries that are not finite.
    """

    W: Array
    visible: Flags
    K: Array | None = None
    S_gt: Array | None = None
    gt_frames: Indices | None = None

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

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read an .npz file, see `of`; a TrackingError says that it is missing, or no .npz."""
        return cls.of(_read_npz(path), path)

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]], path: Path) -> Self:
        """Of a file's `W` and optionally `visible` (absent: what is finite), `K`, `S_gt`, `gt_frames` (absent: all).

        W may be a matrix (2F, P), x and y of frame after frame, and S_gt likewise (3K, P). Pixels become square.

        Raises:
            TrackingError: there is no `W`, or the arrays do not fit.
        """
        if "W" not in arrays:
            problem = f"{path} has no array W (frames, 2, points), only {_names(arrays)}"
            if "W_px" in arrays:
                raise TrackingError(f"{problem}; with W_px it is a file of truth only", "truth")
            raise TrackingError(problem)
        try:
            W = _numbers("W", arrays)
            visible = _flags("visible", arrays)
            if visible is None:
                visible = np.asarray(np.isfinite(W).all(axis=1) if W.ndim == 3 else np.zeros((0, 0), bool))
            given = {name: _numbers(name, arrays) for name in ("K", "S_gt") if name in arrays}
            gt_frames = _frame_numbers(arrays)
            if gt_frames is None and len(given.get("S_gt", [])) == len(W):
                gt_frames = np.arange(len(W))
            tracks = cls(W, visible, given.get("K"), given.get("S_gt"), gt_frames)
            check_extent(tracks.W, tracks.visible)
            return tracks.with_square_pixels()
        except TrackingError as error:
            raise TrackingError(f"{path}: {error}") from None

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
        """Write what `load` reads into a file that is open, as .npz."""
        optional = {"K": self.K, "S_gt": self.S_gt, "gt_frames": self.gt_frames}
        arrays: dict[str, Any] = {name: value for name, value in optional.items() if value is not None}
        np.savez_compressed(file, W=self.W, visible=self.visible, **arrays)


@dataclass(frozen=True)
class Truth:
    """True shapes of some frames, with the pixels their points are seen at.

    Attributes:
        W_px: (K, 2, P) pixel positions.
        S: (K, 3, P) true shapes in camera axes (x right, y down, z forward), any unit.
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

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read an .npz file: `S_gt`, `gt_frames` and `W_px` (K, 2, P), or the `W` (F, 2, P) of a track file.

        Raises:
            TrackingError: the file is missing, is no .npz, lacks an array, or its arrays do not fit.
        """
        arrays = _read_npz(path)
        needed = ("S_gt", "gt_frames") if "W" in arrays else ("S_gt", "gt_frames", "W_px")
        missing = [name for name in needed if name not in arrays]
        if missing:
            raise TrackingError(f"{path} is no truth: no array {', '.join(missing)}, only {_names(arrays)}")
        if "W_px" not in arrays:
            tracks = Tracks.load(path)
            assert tracks.S_gt is not None
            assert tracks.gt_frames is not None
            return cls(tracks.W[tracks.gt_frames], tracks.S_gt, tracks.gt_frames, tracks.K)
        try:
            frames = _frame_numbers(arrays)
            assert frames is not None
            K = _numbers("K", arrays) if "K" in arrays else None
            return cls(_numbers("W_px", arrays), _numbers("S_gt", arrays), frames, K)
        except TrackingError as error:
            raise TrackingError(f"{path}: {error}") from None


def _read_npz(path: Path) -> dict[str, NDArray[Any]]:
    if not path.is_file():
        raise TrackingError(f"no file {path}; check the path")
    try:
        if not zipfile.is_zipfile(path):
            raise TrackingError(f"{path} is not an .npz file; write it with numpy.savez")
        with zipfile.ZipFile(path) as archive:
            size = sum(member.file_size for member in archive.infolist())
        if size > LARGEST_BYTES:
            raise TrackingError(f"{path} unpacks to {size / 2**30:.0f} GB; at most {LARGEST_BYTES / 2**30:.0f} are read")
        with np.load(path, allow_pickle=False) as file:
            found = {name: file[name] for name in file.files}
        strange = [name for name, value in found.items() if not isinstance(value, np.ndarray)]
        if strange:
            raise TrackingError(f"{path} holds {strange[0]}, which is no array: write it with numpy.savez")
        return found
    except TrackingError:
        raise
    except Exception as error:  # damaged archives raise a dozen different things, MemoryError among them
        raise TrackingError(f"{path} is damaged or holds objects that are not arrays ({error})") from None


def _names(arrays: Mapping[str, object]) -> str:
    return ", ".join(sorted(arrays)) or "nothing"


def _numbers(name: str, arrays: Mapping[str, NDArray[Any]]) -> Array:
    array = arrays[name]
    if array.dtype.kind not in "fiu":
        raise TrackingError(f"{name} holds {array.dtype}, but numbers are needed")
    if (rows := ROWS.get(name)) and array.ndim == 2 and len(array) % rows == 0:
        array = array.reshape(-1, rows, array.shape[1])
    return array.astype(np.float64)


def _flags(name: str, arrays: Mapping[str, NDArray[Any]]) -> Flags | None:
    if name not in arrays:
        return None
    array = arrays[name]
    if array.dtype.kind not in "biu":
        raise TrackingError(f"{name} holds {array.dtype}, but true or false is needed")
    return array.astype(bool)


def _frame_numbers(arrays: Mapping[str, NDArray[Any]]) -> Indices | None:
    if "gt_frames" not in arrays:
        return None
    numbers = _numbers("gt_frames", arrays)
    if not (np.isfinite(numbers).all() and np.all(numbers == np.round(numbers))):
        raise TrackingError("gt_frames holds frame numbers that are not whole")
    return numbers.astype(np.int64)


def _check_intrinsics(K: Array | None) -> None:
    if K is None:
        return
    if K.shape != (3, 3):
        raise _wrong_shape("K", K, "(3, 3)")
    if not (np.isfinite(K).all() and K[0, 0] > 0 and K[1, 1] > 0):
        raise TrackingError("K is no camera matrix; its focal lengths K[0, 0] and K[1, 1] must be positive")
    if abs(K[1, 0]) + abs(K[0, 1]) > SKEW * K[0, 0] or not np.allclose(K[2], (0, 0, 1)):
        raise TrackingError("K is no camera matrix without skew; it must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")


def _check_truth(S: Array, frames: Indices, points: int) -> None:
    if S.ndim != 3 or S.shape[1:] != (3, points) or len(S) == 0:
        raise _wrong_shape("S_gt", S, f"(true frames, 3, {points}) as there are {points} points")
    if not np.isfinite(S).all():
        raise TrackingError("S_gt has entries that are not finite")
    if np.abs(S).max() > LARGEST:
        raise TrackingError(f"S_gt has values beyond {LARGEST:g}")
    if frames.shape != (len(S),):
        raise _wrong_shape("gt_frames", frames, f"({len(S)},) as S_gt has {len(S)} shapes")
    still = np.ptp(S, axis=2).max(axis=1) < 1 / LARGEST
    if still.any():
        raise TrackingError(f"S_gt has a shape without extent: that of frame {frames[still][0]}")
    if frames[0] < 0 or np.any(np.diff(frames) <= 0):
        raise TrackingError("gt_frames must ascend from 0 or later, each frame once")


def _wrong_shape(name: str, array: NDArray[Any], asked: str) -> TrackingError:
    return TrackingError(f"{name} has the shape {array.shape}, but {asked} is needed")
