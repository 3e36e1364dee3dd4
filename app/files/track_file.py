"""Points tracked elsewhere: .npz as `Tracks` keeps them, or MATLAB's .mat as data sets of the field have them."""

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tracking import TrackingError
from tracking.tracks import Tracks

ALSO = {"S": "S_gt", "GT": "S_gt", "P3_gt": "S_gt", "vis": "visible"}  # what data sets call them
ROWS = {"W": 2, "S_gt": 3}  # of a frame, which MATLAB's arrays count last


def holds_tracks(path: Path) -> bool:
    """Whether it is such a file, not a recording."""
    return path.is_file() and (_is_mat(path) or zipfile.is_zipfile(path))


def load_tracks(path: Path) -> Tracks:
    """Tracks from a file.

    Raises:
        TrackingError: missing, damaged, without W, or of arrays that do not fit.
    """
    return Tracks.of(_read_mat(path), path) if path.is_file() and _is_mat(path) else Tracks.load(path)


def _is_mat(path: Path) -> bool:
    return path.suffix.lower() == ".mat"


def _read_mat(path: Path) -> dict[str, NDArray[Any]]:
    from scipy.io import loadmat  # takes its time to load, and few ask

    try:
        found: Mapping[str, Any] = loadmat(path)
    except NotImplementedError:
        raise TrackingError(f"{path} has MATLAB's format 7.3, which is not read: save(..., '-v7')") from None
    except Exception as error:  # damaged files raise a dozen different things
        raise TrackingError(f"{path} is no .mat file, or damaged ({error})") from None
    named = {ALSO.get(name, name) if ALSO.get(name) not in found else name: value for name, value in found.items()}
    return {name: _as_numpy(name, value) for name, value in named.items() if isinstance(value, np.ndarray)}


def _as_numpy(name: str, value: NDArray[Any]) -> NDArray[Any]:
    """An array as NumPy would have it: cells of frames stacked, frames first, lists without a second dimension."""
    if value.dtype == object and value.size and len({np.shape(cell) for cell in value.flat}) == 1:
        value = np.stack(list(value.flat))
    rows = ROWS.get(name)
    if value.ndim == 3 and value.shape[0] == rows and value.shape[1] != rows:
        value = np.moveaxis(value, 2, 0)
    if name == "gt_frames":
        return value.ravel()
    if name == "visible" and np.isin(value, (0, 1)).all():
        return value.astype(np.bool_)
    return value
