"""Mode shapes and their spectrum (paper's Fig. 2)."""

import numpy as np

from app.figures.modes_figure import modes_figure, spectrum, title_of
from app.files.track_file import load_tracks
from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.experiments.basis_time import METRICS
from app.reproduce.experiments.organ import organ
from app.reproduce.lines import FLAG
from app.reproduce.result import Result, Table
from app.reproduce.work import Effort, Work
from reconstruction.basis.mesh import Mesh, triangulate
from reconstruction.basis.modes import modal_basis
from reconstruction.settings import Metric

DRAWN = 5
SHARES = (5, 10, 20, 30)  # numbers of modes whose share of all eigenvalues is told
DOME_POINTS = 600


def mode_shapes(work: Work) -> Result:
    """The modes of a synthetic dome and of the flag, and the flag's spectrum with every distance."""
    dome = organ(DOME_POINTS).rest
    surfaces = [("a dome", dome, triangulate(dome[:2].T), "modes-dome.jpg")]
    truth = load_tracks(work.data / FLAG.file).S_gt
    assert truth is not None
    flag, flag_mesh = truth[0], triangulate(truth[0, :2].T)
    surfaces.append(("flag250", flag, flag_mesh, "modes-flag250.jpg"))
    pictures = {}
    for name, rest, mesh, file in surfaces:
        basis = modal_basis(rest, mesh, 20)
        title, values = title_of(name, basis, "euclidean"), spectrum(basis, mesh, "euclidean")
        pictures[file] = modes_figure(basis, mesh, values, title=title, columns=DRAWN, jpeg=True)
        work.step()
    figures = {"modes-dome.jpg": pictures.pop("modes-dome.jpg"), "spectrum.png": spectra(flag, flag_mesh)}
    work.step()
    return Result([shares_table(flag, flag_mesh)], figures, pictures)


def all_eigenvalues(rest: np.ndarray, mesh: Mesh, metric: Metric) -> np.ndarray:
    """(p,) descending."""
    return spectrum(modal_basis(rest, mesh, 1), mesh, metric)


def spectra(rest: np.ndarray, mesh: Mesh) -> bytes:
    """Eigenvalues relative to the first, with every distance."""
    series = []
    for color, (metric, name) in enumerate(METRICS):
        values = all_eigenvalues(rest, mesh, metric)
        positive = values[values > 1e-6 * values[0]]
        series.append(Series(name, list(range(1, len(positive) + 1)), list(positive / values[0]), color))
    return charts([Panel("Eigenvalues of flag250", "mode", "relative to the first", series, logarithmic=True)])


def shares_table(rest: np.ndarray, mesh: Mesh) -> Table:
    """How much of the eigenvalues' sum the first ones hold."""
    rows = []
    for metric, name in METRICS:
        values = all_eigenvalues(rest, mesh, metric).clip(0)
        shares = [float(100 * values[:r].sum() / values.sum()) for r in SHARES]
        rows.append((name, *shares, int((values > 1e-6 * values[0]).sum())))
    columns = ("distance", *(f"first {r}, %" for r in SHARES), "positive eigenvalues")
    return Table("Share of all eigenvalues of flag250, first shape", columns, rows)


def steps(_effort: Effort) -> int:
    """Two surfaces and the spectra."""
    return 3


EXPERIMENT = Experiment(
    "mode-shapes", "Mode shapes and spectrum", mode_shapes, steps, 1.0, files=(FLAG.file,), paper="Fig. 2"
)
