import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from app.files.array_file import holds_arrays
from app.files.track_file import load_tracks
from tracking import TrackingError

F, P = 5, 7
RNG = np.random.default_rng(0)
W, S = RNG.uniform(0, 100, (F, 2, P)), RNG.normal(size=(F, 3, P))
SEEN = RNG.random((F, P)) < 0.7


def cells(frames: Any) -> Any:
    """A MATLAB cell array (1, F) of matrices."""
    made = np.empty((1, len(frames)), object)
    made[0] = [*frames]
    return made


def list_of_structures(field: str, frames: Any) -> Any:
    """A MATLAB structure array (1, F) with one field."""
    made = np.empty((1, len(frames)), [(field, object)])
    made[0] = [(frame,) for frame in frames]
    return made


def homogeneous(points: Any) -> Any:
    """(F, 3, P) with ones."""
    return np.concatenate([points, np.ones((F, 1, P))], axis=1)


@pytest.mark.parametrize(
    "arrays",
    [
        {"W": W, "S_gt": S},
        {"W": W.reshape(2 * F, P), "S": S.reshape(3 * F, P), "Rs": np.zeros((2 * F, 3))},
        {"W": np.moveaxis(W, 0, 2), "P3_gt": np.moveaxis(S, 0, 2), "name": "shark"},
        {"W": cells(W), "GT": cells(S), "scene": {"of": "something"}},
        {"scene": {"p": list_of_structures("p", homogeneous(W)), "Pgth": list_of_structures("P", S)}},
    ],
    ids=["as in NumPy", "matrices", "frames last", "cells", "structures"],
)
def test_tracks_of_matlab(tmp_path: Path, arrays: dict[str, Any]) -> None:
    path = tmp_path / "tracks.mat"
    savemat(path, {**arrays, "visible": SEEN.astype(float), "K": np.diag([500.0, 500, 1])})
    read = load_tracks(path)
    assert holds_arrays(path)
    np.testing.assert_array_equal(read.W, W)
    np.testing.assert_array_equal(read.S_gt, S)
    np.testing.assert_array_equal(read.visible, SEEN)
    np.testing.assert_array_equal(read.gt_frames, np.arange(F))


def test_true_frames_are_a_list(tmp_path: Path) -> None:
    path = tmp_path / "tracks.MAT"
    savemat(path, {"W": W, "S_gt": S[:2], "S": S, "gt_frames": [0.0, 3.0]})
    read = load_tracks(path)
    np.testing.assert_array_equal(read.gt_frames, [0, 3])
    np.testing.assert_array_equal(read.S_gt, S[:2])


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is no .mat file, or damaged"),
        (b"W = 1, 2, 3", "is no .mat file, or damaged"),
        (b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(512), "format 7.3, which is not read: save(..., '-v7')"),
    ],
)
def test_files_that_are_no_mat(tmp_path: Path, content: bytes, says: str) -> None:
    path = tmp_path / "tracks.mat"
    path.write_bytes(content)
    with pytest.raises(TrackingError, match=re.escape(says)):
        load_tracks(path)


def test_normalised_points_are_seen_by_a_camera_of_focal_length_1(tmp_path: Path) -> None:
    path = tmp_path / "tracks.mat"
    savemat(path, {"m": list_of_structures("m", homogeneous(W / 500)), "KK": np.diag([500.0, 500, 1])})
    read = load_tracks(path)
    np.testing.assert_array_equal(read.W, W / 500)
    np.testing.assert_array_equal(read.K, np.eye(3))


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    path = tmp_path / "tracks.mat"
    savemat(path, {"P3": S})
    with pytest.raises(TrackingError, match=re.escape("has no array W (frames, 2, points), only P3")):
        load_tracks(path)
    with pytest.raises(TrackingError, match="no file"):
        load_tracks(tmp_path / "none.mat")
