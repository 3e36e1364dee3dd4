"""Part 1: the window step, beside its physical limit and beside general solvers of least squares."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from app.bench.timing import Log, growth, least_s
from app.rivals.problems import WindowStep, full_model, summed, window_step
from app.terminal.errors import UsageError
from reconstruction.window.marginal import Previous
from reconstruction.window.solver import Solution, Solver, minimise
from reconstruction.window.statistics import stack

POINTS = (250, 828, 3_024, 28_887, 100_000)
MODES = (10, 20, 30)
DEFORMATIONS = ("bending", "general")
QUICK_POINTS, QUICK_MODES = (250, 828, 28_887), (30,)
RIVAL_POINTS = (250, 828, 3_024)  # beyond, the Jacobian alone takes gigabytes
CERES_REPEATS = 8
IN_A_ROW = 5  # of our few milliseconds, of which the first would find the cache full of the rival's
ITERATIONS = 4  # timed together
SAME_COST = 1e-6  # relative: who ends so near the least energy is timed
LADDER = tuple(10.0**-k for k in range(3, 13))  # tolerances, loosest first: everyone may stop as early as that allows


@dataclass(frozen=True)
class Timing:
    """One new frame: milliseconds."""

    points: int
    modes: int
    deformation: str
    statistics_ms: float
    """Summing up its points."""
    dgemm_ms: float
    """One matrix product of the same size."""
    iteration_ms: float
    """One iteration of Levenberg-Marquardt."""
    iterations: int
    step_ms: float
    """Sums and all iterations, until a step gains less than the solver's tolerance, as in a run."""


@dataclass(frozen=True)
class Race:
    """The same energy from the same start to the same end: milliseconds, of a whole step."""

    points: int
    modes: int
    deformation: str
    ours_ms: float
    scipy_ms: float
    ceres_ms: float | None
    """None: pyceres is not installed."""


def timings(*, quick: bool, log: Log) -> list[Timing]:
    """Every size."""
    steps: list[tuple[WindowStep, str]] = []
    for points in QUICK_POINTS if quick else POINTS:
        log(f"window step, {points} points")
        model = full_model(points)
        for modes in QUICK_MODES if quick else MODES:
            steps += [(window_step(model, modes, deformation), deformation) for deformation in DEFORMATIONS[quick:]]
    log("one iteration")
    iteration_s = {}
    for kind in {(step.modes, deformation) for step, deformation in steps}:
        alike = [step for step, deformation in steps if (step.modes, deformation) == kind]
        iteration_s[kind] = dict(
            zip([s.points for s in alike], least_s(*map(iterations, alike), budget_s=1.0), strict=True)
        )
    return [timed(*each, iteration_s[each[0].modes, each[1]][each[0].points]) for each in steps]


def iterations(step: WindowStep) -> Callable[[], Solution]:
    """Four iterations of a step whose points are summed up."""
    data = stack([step.earlier, summed(step.B, step.W[-1], step.focal)])
    return lambda: minimise(
        step.energy, data, step.start, Previous(step.before), Solver(iterations=ITERATIONS, tolerance=0.0)
    )


def timed(step: WindowStep, deformation: str, iterations_s: float) -> Timing:
    """One size; sums and matrix product in turn, so that both see the same machine."""
    B, W = step.B, step.W[-1]
    left, right = np.tile(B, (4, 1)), np.ascontiguousarray(B.T)
    sums_s, dgemm_s = least_s(lambda: summed(B, W, step.focal), lambda: left @ right)
    found = solved(step, Solver())
    (step_s,) = least_s(lambda: solved(step, Solver()))
    return Timing(
        points=step.points,
        modes=step.modes,
        deformation=deformation,
        statistics_ms=1e3 * sums_s,
        dgemm_ms=1e3 * dgemm_s,
        iteration_ms=1e3 * iterations_s / ITERATIONS,
        iterations=found.steps,
        step_ms=1e3 * step_s,
    )


def solved(step: WindowStep, solver: Solver) -> Solution:
    """What a run does for a new frame."""
    data = stack([step.earlier, summed(step.B, step.W[-1], step.focal)])
    return minimise(step.energy, data, step.start, Previous(step.before), solver)


def races(*, quick: bool, log: Log) -> Iterator[Race]:
    """Against SciPy and Ceres."""
    for points in (828,) if quick else RIVAL_POINTS:
        model = full_model(points)
        for modes in QUICK_MODES if quick else MODES:
            for deformation in DEFORMATIONS[quick:]:
                log(f"SciPy and Ceres, {points} points, {modes} modes, {deformation}")
                yield race(window_step(model, modes, deformation), deformation)


def race(step: WindowStep, deformation: str) -> Race:
    """Everybody with the loosest tolerance that ends at the same cost."""
    from app.rivals.scipy_rival import ScipyWindow

    least = float(solved(step, Solver(iterations=100, tolerance=1e-13)).value.sum())
    scipy = ScipyWindow(step)
    runners: list[Callable[[float], float]] = [
        lambda tolerance: float(solved(step, Solver(iterations=100, tolerance=tolerance)).value.sum()),
        scipy.solve,
    ]
    ceres_ms = None
    try:
        from app.rivals.ceres import CeresWindow
    except ImportError:
        pass
    else:
        ceres = CeresWindow(step)
        tolerance = loosest(lambda tolerance: ceres.solve(tolerance).energy, least)
        ceres_ms = min(ceres.solve(tolerance).milliseconds for _ in range(CERES_REPEATS))
    ours, theirs = (at(run, loosest(run, least)) for run in runners)
    *ours_s, scipy_s = least_s(*[ours] * IN_A_ROW, theirs, budget_s=1.5)
    return Race(step.points, step.modes, deformation, 1e3 * min(ours_s), 1e3 * scipy_s, ceres_ms)


def at(run: Callable[[float], float], tolerance: float) -> Callable[[], float]:
    """The run with a tolerance."""
    return lambda: run(tolerance)


def loosest(run: Callable[[float], float], least: float) -> float:
    """The loosest tolerance with which a solver ends at the least energy.

    Raises:
        UsageError: none does.
    """
    for tolerance in LADDER:
        if run(tolerance) <= least * (1 + SAME_COST):
            return tolerance
    raise UsageError("a solver does not reach the common energy: the benchmark's energies differ; please report it")


def ratios(timings: list[Timing], races: list[Race]) -> dict[str, float | None]:
    """The figures that have targets."""
    largest = [t for t in timings if t.modes == max(t.modes for t in timings) and t.deformation == "general"]
    headline = next(race for race in races if (race.points, race.modes, race.deformation) == (828, 30, "general"))
    iteration = [t.iteration_ms for t in largest]
    return {
        "scipy_over_ours": headline.scipy_ms / headline.ours_ms,
        "ceres_over_ours": headline.ceres_ms / headline.ours_ms if headline.ceres_ms else None,
        "iteration_spread": max(iteration) / min(iteration),
        "statistics_over_dgemm": next(t.statistics_ms / t.dgemm_ms for t in largest if t.points == 828),
        "statistics_over_dgemm_largest": largest[-1].statistics_ms / largest[-1].dgemm_ms,
        "growth_with_points": growth([t.points for t in largest], [t.step_ms for t in largest]),
    }
