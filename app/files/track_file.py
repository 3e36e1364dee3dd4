"""Points tracked elsewhere, and true shapes, from files of arrays."""

from pathlib import Path

import numpy as np

from app.arrays import Array, Flags, Indices
from app.files.array_file import Arrays, read_arrays
from tracking import TrackingError
from tracking.extent import check_extent
from tracking.tracks import Tracks, Truth

ALSO = {"S_gt": ("GT", "P3_gt", "S"), "visible": ("vis",)}  # what data sets call them
ROWS = {"W": 2, "W_px": 2, "S_gt": 3}  # of a frame, in matrices and arrays of any order


def load_tracks(path: Path) -> Tracks:
    """Tracks from `W` and optionally `visible` (absent: what is finite), `K`, `S_gt`, `gt_frames` (absent: all).

    W may as well be (2F, P), x and y of frame after frame, (F, P, 2) or (2, P, F); S_gt likewise. Pixels become square.

    Raises:
        TrackingError: the file is missing, damaged, lacks `W`, or its arrays do not fit.
    """
    return _tracks(_named(read_arrays(path)), path)


def _tracks(arrays: Arrays, path: Path) -> Tracks:
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
        tracks = Tracks(W, visible, given.get("K"), given.get("S_gt"), gt_frames)
        check_extent(tracks.W, tracks.visible)
        return tracks.with_square_pixels()
    except TrackingError as error:
        raise TrackingError(f"{path}: {error}") from None


def load_truth(path: Path) -> Truth:
    """Truth from `S_gt`, `gt_frames` and `W_px` (K, 2, P), or the `W` (F, 2, P) of tracks.

    Raises:
        TrackingError: the file is missing, damaged, lacks an array, or its arrays do not fit.
    """
    arrays = _named(read_arrays(path))
    needed = ("S_gt", "gt_frames") if "W" in arrays else ("S_gt", "gt_frames", "W_px")
    missing = [name for name in needed if name not in arrays]
    if missing:
        raise TrackingError(f"{path} is no truth: no array {', '.join(missing)}, only {_names(arrays)}")
    if "W_px" not in arrays:
        tracks = _tracks(arrays, path)
        assert tracks.S_gt is not None
        assert tracks.gt_frames is not None
        return Truth(tracks.W[tracks.gt_frames], tracks.S_gt, tracks.gt_frames, tracks.K)
    try:
        frames = _frame_numbers(arrays)
        assert frames is not None
        K = _numbers("K", arrays) if "K" in arrays else None
        return Truth(_numbers("W_px", arrays), _numbers("S_gt", arrays), frames, K)
    except TrackingError as error:
        raise TrackingError(f"{path}: {error}") from None


def _named(arrays: Arrays) -> Arrays:
    """The same under our names."""
    others = {name: also for name, alike in ALSO.items() if name not in arrays for also in alike if also in arrays}
    return {**{name: arrays[also] for name, also in others.items()}, **arrays}


def _names(arrays: Arrays) -> str:
    return ", ".join(sorted(arrays)) or "nothing"


def _numbers(name: str, arrays: Arrays) -> Array:
    array = arrays[name]
    if array.dtype.kind not in "fiu":
        raise TrackingError(f"{name} holds {array.dtype}, but numbers are needed")
    if (rows := ROWS.get(name)) and array.ndim == 2 and len(array) % rows == 0:
        array = array.reshape(-1, rows, array.shape[1])
    elif rows in array.shape and array.ndim == 3 and array.shape[1] != rows:  # coordinates last, or first
        array = array.swapaxes(1, 2) if array.shape[2] == rows else np.moveaxis(array, 2, 0)
    return array.astype(np.float64)


def _flags(name: str, arrays: Arrays) -> Flags | None:
    if name not in arrays:
        return None
    array = arrays[name]
    if array.dtype.kind not in "biu" and not np.isin(array, (0, 1)).all():
        raise TrackingError(f"{name} holds {array.dtype}, but true or false is needed")
    return array.astype(bool)


def _frame_numbers(arrays: Arrays) -> Indices | None:
    if "gt_frames" not in arrays:
        return None
    numbers = _numbers("gt_frames", arrays).ravel()  # MATLAB's lists have two dimensions
    if not (np.isfinite(numbers).all() and np.all(numbers == np.round(numbers))):
        raise TrackingError("gt_frames holds frame numbers that are not whole")
    return numbers.astype(np.int64)
