"""Times against the number of points."""

from typing import BinaryIO

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from app.bench.basis import BasisTime
from app.bench.window import Race, Timing


def draw(file: BinaryIO, kind: str, timings: list[Timing], races: list[Race], basis_times: list[BasisTime]) -> None:
    """Write the figure: window step, its rivals, basis."""
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    steps, rivals, basis = figure.subplots(1, 3)
    for modes in sorted({timing.modes for timing in timings}):
        some = [t for t in timings if t.modes == modes and t.deformation == "general"]
        points = [t.points for t in some]
        steps.plot(points, [t.step_ms for t in some], "o-", label=f"step, r = {modes}")
        steps.plot(points, [t.iteration_ms for t in some], ":", color=steps.lines[-1].get_color(), label="one iteration")
    titled(steps, "Window step, general", "ms")
    some_races = [race for race in races if race.modes == max(r.modes for r in races) and race.deformation == "general"]
    points = [race.points for race in some_races]
    rivals.plot(points, [race.ours_ms for race in some_races], "o-", label="ours")
    rivals.plot(points, [race.scipy_ms for race in some_races], "s-", label="scipy least_squares")
    if any(race.ceres_ms for race in some_races):
        rivals.plot(points, [race.ceres_ms or float("nan") for race in some_races], "^-", label="Ceres")
    titled(rivals, "To the same cost, r = 30, general", "ms")
    for metric in ("euclidean", "manhattan"):
        own = [t for t in basis_times if t.metric == metric]
        basis.plot([t.points for t in own], [t.build_s + t.eigenpairs_s for t in own], "o-", label=f"ours, {metric}")
    full = [t for t in basis_times if t.metric == "euclidean"]
    basis.plot([t.points for t in full], [t.eigh_s or float("nan") for t in full], "s--", label="all eigenvectors")
    basis.plot([t.points for t in full], [t.modal_analysis_s or float("nan") for t in full], "^--", label="modal analysis")
    titled(basis, "Basis, 30 modes", "s")
    figure.savefig(file, format=kind, dpi=120)


def titled(axes: Axes, title: str, unit: str) -> None:
    """Logarithmic, with a legend."""
    axes.set(title=title, xlabel="points", ylabel=unit, xscale="log", yscale="log")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
