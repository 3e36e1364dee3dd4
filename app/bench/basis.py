"""Part 2: the modal basis, beside all eigenvectors and beside modal analysis (the paper's Fig. 4 and Table 1)."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from time import process_time
from typing import TypeVar

import numpy as np
from scipy.linalg import eigh, subspace_angles

from app.bench.own_process import apart
from app.bench.timing import Log
from app.rivals.modal_analysis import vibration_modes
from app.rivals.problems import MODES, surface_with_mesh
from reconstruction.basis import distances, landmarks
from reconstruction.basis.modes import EXACT_POINTS, doubly_centred, leading_eigenpairs
from reconstruction.settings import Metric

POINTS = (56, 594, 3_024, 28_887)
QUICK_POINTS = (56, 594, 28_887)
METRICS: tuple[Metric, ...] = ("euclidean", "manhattan")
MOST_FOR_EIGH, MOST_FOR_MODAL_QUICK = 3_024, 594
COMPARED_POINTS, COMPARED_MODES = 3_024, 10  # where the exact subspace is at hand
REPEATS = 5  # of what takes less than ...
SHORT_S = 0.5

T = TypeVar("T")


@dataclass(frozen=True)
class BasisTime:
    """Processor seconds, of one core, for 30 modes."""

    points: int
    metric: str
    build_s: float
    """Distances, centred; of many points those to the landmarks."""
    eigenpairs_s: float
    peak_mb: float
    """Memory of a process that does nothing else."""
    eigh_s: float | None
    """All eigenpairs by scipy.linalg.eigh; None where not tried."""
    modal_analysis_s: float | None
    """As many modes of an elastic shell; None where not tried."""


def basis_times(*, quick: bool, log: Log) -> Iterator[BasisTime]:
    """Every size and metric."""
    for points in QUICK_POINTS if quick else POINTS:
        log(f"basis, {points} points")
        modal_s = None
        if points <= MOST_FOR_MODAL_QUICK or not quick:
            log(f"modal analysis, {points} points")
            modal_s = modal_analysis_s(points)
        for metric in METRICS:
            (build_s, eigenpairs_s), peak_mb = apart(own_times, points, metric)
            eigh_s = all_eigenpairs_s(points, metric) if points <= MOST_FOR_EIGH else None
            yield BasisTime(points, metric, build_s, eigenpairs_s, peak_mb, eigh_s, modal_s)


def own_times(points: int, metric: Metric) -> tuple[float, float]:
    """Seconds of distances and of eigenpairs, the ways `modal_basis` takes."""
    rest, mesh = surface_with_mesh(points)
    if points > EXACT_POINTS:
        chosen = landmarks.landmarks(rest, MODES)
        to, build_s = clocked(lambda: distances.dissimilarity(metric, rest, mesh.edges, chosen))
        return build_s, clocked(lambda: landmarks.eigenpairs_of(to, chosen, MODES))[1]
    D, build_s = clocked(lambda: doubly_centred(distances.dissimilarity(metric, rest, mesh.edges)))
    return build_s, clocked(lambda: leading_eigenpairs(D, MODES))[1]


def all_eigenpairs_s(points: int, metric: Metric) -> float:
    """Seconds of a full decomposition."""
    rest, mesh = surface_with_mesh(points)
    D = doubly_centred(distances.dissimilarity(metric, rest, mesh.edges))
    return clocked(lambda: eigh(D))[1]


def modal_analysis_s(points: int) -> float:
    """Seconds of stiffness, mass and their lowest modes."""
    rest, mesh = surface_with_mesh(points)
    return clocked(lambda: vibration_modes(rest, mesh.faces, MODES))[1]


def clocked(work: Callable[[], T]) -> tuple[T, float]:
    """What the work gives, and its seconds: of short work the least of several."""
    least = np.inf
    for _ in range(REPEATS):
        started = process_time()
        result = work()
        least = min(least, process_time() - started)
        if least > SHORT_S:
            break
    return result, least


def angle_degrees(metric: Metric, log: Log) -> float:
    """Largest angle between the leading modes that landmarks give and the exact ones."""
    log(f"landmarks against exact modes, {metric}")
    rest, mesh = surface_with_mesh(COMPARED_POINTS)
    exact = leading_eigenpairs(doubly_centred(distances.dissimilarity(metric, rest, mesh.edges)), COMPARED_MODES)[1]
    near = landmarks.leading_eigenpairs(rest, mesh.edges, COMPARED_MODES, metric)[1]
    return float(np.rad2deg(subspace_angles(exact.T, near)).max())


def ratios(times: list[BasisTime], angles: Mapping[Metric, float]) -> dict[str, float | None]:
    """The figures that have targets."""
    words: dict[str, float | None] = {}
    for time in times:
        total = time.build_s + time.eigenpairs_s
        name = f"{time.metric}_{time.points}"
        if time.eigh_s:
            words[f"eigh_over_ours_{name}"] = time.eigh_s / time.eigenpairs_s
        if time.modal_analysis_s:
            words[f"modal_analysis_over_ours_{name}"] = time.modal_analysis_s / total
        if time.points > EXACT_POINTS:
            words |= {f"{name}_s": total, f"{name}_mb": time.peak_mb}
    return words | {f"angle_deg_{metric}": angle for metric, angle in angles.items()}
