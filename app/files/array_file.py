"""Arrays in a file by name: NumPy's .npz, or MATLAB's .mat."""

import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tracking import TrackingError

LARGEST_BYTES = 4 * 2**30  # of arrays in a file

Arrays = Mapping[str, NDArray[Any]]


def holds_arrays(path: Path) -> bool:
    """Whether there is such a file."""
    return path.is_file() and (_is_mat(path) or zipfile.is_zipfile(path))


def read_arrays(path: Path) -> Arrays:
    """All arrays of a file.

    Raises:
        TrackingError: it is missing, damaged, too large, or holds what is no array.
    """
    if not path.is_file():
        raise TrackingError(f"no file {path}; check the path")
    return _read_mat(path) if _is_mat(path) else _read_npz(path)


def _is_mat(path: Path) -> bool:
    return path.suffix.lower() == ".mat"


def _read_npz(path: Path) -> Arrays:
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


def _read_mat(path: Path) -> Arrays:
    from scipy.io import loadmat  # takes its time to load, and few ask
    from scipy.sparse import issparse

    try:
        found: Mapping[str, Any] = loadmat(path)
    except NotImplementedError:
        raise TrackingError(f"{path} has MATLAB's format 7.3, which is not read: save(..., '-v7')") from None
    except Exception as error:  # damaged files raise a dozen different things
        raise TrackingError(f"{path} is no .mat file, or damaged ({error})") from None
    whole = ((name, cast(Any, value).toarray() if issparse(value) else value) for name, value in found.items())
    return dict(_of_structs((name, value) for name, value in whole if isinstance(value, np.ndarray)))


def _of_structs(found: Iterable[tuple[str, NDArray[Any]]]) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays in MATLAB's structures by the names of their fields; if a list of these has one field only, by its own."""
    for name, value in found:
        fields = value.dtype.names or ()
        if not fields:
            yield name, _of_cells(value)
        elif value.size == 1:
            yield from _of_structs((field, np.asarray(value[field].flat[0])) for field in fields)
        else:
            yield from ((name if len(fields) == 1 else field, _of_cells(value[field])) for field in fields)


def _of_cells(value: NDArray[Any]) -> NDArray[Any]:
    """The matrices in a MATLAB cell array, if they are alike, as one array."""
    if value.dtype != object or len({np.shape(cell) for cell in value.flat}) != 1:
        return value
    if any(np.asarray(cell).dtype.kind not in "biuf" for cell in value.flat):
        return value
    return np.stack(list(value.flat))
