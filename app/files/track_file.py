"""Points tracked elsewhere, and true shapes, from files of arrays."""

import warnings
from pathlib import Path

import numpy as np

from app.arrays import Array, Flags, Indices
from app.files.array_file import Arrays, read_arrays
from tracking import TrackingError
from tracking.extent import check_extent
from tracking.tracks import FEWEST_KNOWN, Tracks, Truth, known_points

ALSO = {  # what data sets call them; m is K⁻¹ p
    "W": ("p2_obs", "p", "m"),
    "S_gt": ("GT", "P3_gt", "S", "Pgth", "Pgt"),
    "visible": ("vis", "visb"),
    "K": ("KK",),
}
ROWS = {"W": 2, "W_px": 2, "S_gt": 3}  # of a frame, in matrices and arrays of any order
ALIKE = 0.3  # of its extent: rows of a matrix that differ by less are of one coordinate
EXCHANGED = "W is taken for {} frames of {} points, but looks like points of frames: give (F, 2, P), or (F, P, 2)"
OFTEN, DENSE = 2.0, 20  # times the way from point to point; usual tracks have 0.05 to 0.4
PROJECTED = "no W: the true shapes are looked at {}"


def load_tracks(path: Path) -> Tracks:
    """Tracks from `W` and optionally `visible` (absent: what is finite), `K`, `S_gt`, `gt_frames` (absent: all).

    W may as well be (2F, P), x and y of frame after frame or all x before all y, (F, P, 2) or (2, P, F); S_gt likewise.
    Pixels become square. Without W the true shapes are projected.

    Raises:
        TrackingError: the file is missing, damaged, lacks `W` and true shapes, or its arrays do not fit.
    """
    return _tracks(_named(read_arrays(path)), path).with_square_pixels()


def _tracks(arrays: Arrays, path: Path) -> Tracks:
    if "W" not in arrays and ("S_gt" not in arrays or {"W_px", "gt_frames"} & {*arrays}):
        problem = f"{path} has no array W (frames, 2, points), only {_names(arrays)}"
        if "W_px" in arrays:
            raise TrackingError(f"{problem}; with W_px it is a file of truth only", "truth")
        raise TrackingError(problem)
    try:
        K, S = (_numbers(name, arrays) if name in arrays else None for name in ("K", "S_gt"))
        S = None if S is None else _known(S)
        W, note = (_numbers("W", arrays), "") if S is None or "W" in arrays else _projected(S, K)
        visible = _flags("visible", arrays)
        if visible is None:
            visible = np.asarray(np.isfinite(W).all(axis=1) if W.ndim == 3 else np.zeros((0, 0), bool))
        elif W.ndim == 3 and visible.shape == (W.shape[2], len(W)) != (len(W), W.shape[2]):  # points by frames
            visible = visible.T
        gt_frames = _frame_numbers(arrays)
        if gt_frames is None and S is not None and len(S) == len(W):
            gt_frames = np.arange(len(W))
        if S is not None and gt_frames is not None:
            S, gt_frames = _told(S, gt_frames)
        tracks = Tracks(W, visible, K, S, gt_frames, note or exchanged(W, visible))
        check_extent(tracks.W, tracks.visible)
        return tracks
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
        W_px, (S, told) = _numbers("W_px", arrays), _told(_known(_numbers("S_gt", arrays)), frames)
        return Truth(W_px[np.isin(frames, told)] if len(W_px) == len(frames) else W_px, S, told, K)
    except TrackingError as error:
        raise TrackingError(f"{path}: {error}") from None


def _named(arrays: Arrays) -> Arrays:
    """The same under our names."""
    called = {name: name for name in arrays}
    for name, others in ALSO.items():
        for other in () if name == "S_gt" and "Upsilon" in arrays else others:  # shapes estimated here are no truth
            if other in arrays and arrays[other].ndim > 1 and arrays[other].size > 1:
                called.setdefault(name, other)
    named = {name: arrays[other] for name, other in called.items()}
    return {**named, "K": np.eye(3)} if called.get("W") == "m" else named


def _projected(S: Array, K: Array | None) -> tuple[Array, str]:
    """Image points (F, 2, P) of shapes (F, 3, P), seen by a camera K, or along z without perspective; and a note."""
    if K is None:
        return S[:, :2], PROJECTED.format("along z")
    return (K @ S)[:, :2] / S[:, 2:], PROJECTED.format("by K")


def _told(S: Array, frames: Indices) -> tuple[Array, Indices]:
    """True shapes (K, 3, P) of frames (K,) but those that know too few points."""
    if S.ndim != 3 or S.shape[1] != 3 or frames.shape != (len(S),):
        return S, frames
    told = known_points(S).sum(axis=1) >= FEWEST_KNOWN
    return (S[told], frames[told]) if told.any() else (S, frames)


def _known(S: Array) -> Array:
    """Shapes with NaN for points at the origin: no camera sees it."""
    return np.where((S == 0).all(axis=1, keepdims=True), np.nan, S) if S.ndim == 3 else S


def exchanged(W: Array, visible: Flags) -> str:
    """A note where tracks (F, 2, P) look as if frames and points were exchanged: what moves does so by little in a frame.

    Neighbours on a dense grid are near each other, too: not of many more points than frames.
    """
    if W.ndim != 3 or W.shape[::2] != visible.shape or min(visible.shape) < 3 or visible.shape[1] > DENSE * len(W):
        return ""
    seen = np.where(visible[:, None], W, np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames or points of which nothing is known
        in_frames, beside = (float(np.nanmedian(np.abs(np.diff(seen, axis=axis)))) for axis in (0, 2))
    return EXCHANGED.format(*visible.shape) if in_frames > OFTEN * beside else ""


def _names(arrays: Arrays) -> str:
    return ", ".join(sorted(arrays)) or "nothing"


def _numbers(name: str, arrays: Arrays) -> Array:
    array = arrays[name]
    if array.dtype.kind not in "fiu":
        raise TrackingError(f"{name} holds {array.dtype}, but numbers are needed")
    array, rows = array.astype(np.float64), ROWS.get(name)
    if rows is None:
        return array
    if array.ndim == 2 and len(array) % rows == 0:
        if _by_coordinate(array, rows):
            return array.reshape(rows, -1, array.shape[1]).swapaxes(0, 1)
        return array.reshape(-1, rows, array.shape[1])
    if array.ndim == 3 and array.shape[1] == 3 and rows == 2 and (array[:, 2] == 1).all():  # homogeneous
        return array[:, :2]
    if rows in array.shape and array.ndim == 3 and array.shape[1] != rows:  # coordinates last, or first
        return array.swapaxes(1, 2) if array.shape[2] == rows else np.moveaxis(array, 2, 0)
    return array


def _by_coordinate(matrix: Array, count: int) -> bool:
    """Whether the rows of a matrix (n, P) are one coordinate of all frames, then the next, not frame after frame.

    Then rows beside each other are alike: what moves looks like it did the frame before, but x is not like y.
    """
    rows = np.where(matrix == 0, np.nan, matrix)  # some data sets write so what is hidden
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # rows of which nothing is known
        extent = _deviation(rows)
        near, far = (
            np.nanmedian(_deviation(rows[k:] - rows[:-k]) / np.maximum(extent[k:], extent[:-k])) for k in (1, count)
        )
        # Along a diagonal x is like y, too: but each is more like itself in the next frame.
        return bool(near < ALIKE and near <= 2 * far)


def _deviation(rows: Array) -> Array:
    """Median absolute deviation (n,) of each row (n, P) from its median, of what is not NaN."""
    return np.asarray(np.nanmedian(np.abs(rows - np.nanmedian(rows, axis=1, keepdims=True)), axis=1))


def _flags(name: str, arrays: Arrays) -> Flags | None:
    if name not in arrays:
        return None
    array = arrays[name]
    if array.dtype.kind not in "biu" and not np.isin(array, (0, 1)).all():
        raise TrackingError(f"{name} holds {array.dtype}, but true or false is needed")
    flags = array.astype(bool)
    return flags.reshape(len(flags), -1) if flags.ndim == 3 and 1 in flags.shape[1:] else flags  # rows in cells


def _frame_numbers(arrays: Arrays) -> Indices | None:
    if "gt_frames" not in arrays:
        return None
    numbers = _numbers("gt_frames", arrays).ravel()  # MATLAB's lists have two dimensions
    if not (np.isfinite(numbers).all() and np.all(numbers == np.round(numbers))):
        raise TrackingError("gt_frames holds frame numbers that are not whole")
    return numbers.astype(np.int64)
