"""The benchmarks measure what they say: rivals minimise the same energy, modal analysis is elastic, tables agree."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from app.bench import basis, window
from app.bench.own_process import apart
from app.bench.targets import TARGETS, markdown, rows
from app.bench.timing import growth, least_s
from app.options.bench import Bench
from app.rivals import problems
from app.rivals.modal_analysis import shell, vibration_modes
from app.rivals.problems import WindowStep, full_model, summed, surface_with_mesh, window_step
from app.rivals.residuals import parameters
from app.rivals.scipy_rival import ScipyWindow, exponential, exponential_slope
from app.terminal.errors import UsageError
from reconstruction.camera import quaternion_exp
from reconstruction.window.energy import evaluate
from reconstruction.window.marginal import Past
from reconstruction.window.solver import Solver
from reconstruction.window.statistics import stack


@pytest.fixture(scope="module", autouse=True)
def one_core() -> Iterator[None]:
    with threadpool_limits(1):
        yield


@pytest.fixture(scope="module")
def step() -> WindowStep:
    return window_step(full_model(80), 6, "general")


@pytest.mark.parametrize("deformation", window.DEFORMATIONS)
def test_scipy_minimises_the_energy_of_the_solver(deformation: str) -> None:
    step = window_step(full_model(60), 5, deformation)
    data = stack([step.settled, summed(step.B, step.W[-1], step.focal)])
    scipy = ScipyWindow(step)
    x = np.concatenate([np.zeros((problems.WINDOW, 3)), parameters(step.start, step.energy.rows)[:, 4:]], axis=1).ravel()
    ours = evaluate(step.energy, data, step.start, Past(step.before)).sum()
    assert (scipy.residuals(x) ** 2).sum() == pytest.approx(ours, rel=1e-9)
    end = window.solved(step, Solver(iterations=100, tolerance=1e-12)).value.sum()
    assert scipy.solve(1e-12) == pytest.approx(end, rel=1e-6)
    assert end < 0.9 * ours


def test_its_jacobian_is_the_derivative(step: WindowStep) -> None:
    scipy, rng = ScipyWindow(step), np.random.default_rng(0)
    n = problems.WINDOW
    x = np.concatenate([np.zeros((n, 3)), parameters(step.start, step.energy.rows)[:, 4:]], axis=1).ravel()
    x = x + 0.05 * rng.normal(size=x.size)
    direction = 1e-5 * rng.normal(size=x.size)
    difference = (scipy.residuals(x + direction) - scipy.residuals(x - direction)) / 2
    np.testing.assert_allclose(scipy.jacobian(x) @ direction, difference, atol=1e-8 * np.abs(difference).max())


def test_turning_by_nothing_and_by_much() -> None:
    theta = np.array([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0], [0.4, -0.3, 1.0]])
    np.testing.assert_allclose(exponential(theta), quaternion_exp(theta), atol=1e-15)
    for k, step in enumerate(1e-6 * np.eye(3)):
        slope = (exponential(theta + step) - exponential(theta - step)) / 2e-6
        np.testing.assert_allclose(exponential_slope(theta)[:, :, k], slope, atol=1e-9)


def test_ceres_minimises_the_energy_of_the_solver(step: WindowStep) -> None:
    pytest.importorskip("pyceres", reason="pyceres is not installed: pip install 'modeshape[bench]'")
    from app.rivals.ceres import CeresWindow

    end = window.solved(step, Solver(iterations=100, tolerance=1e-12)).value.sum()
    found = CeresWindow(step).solve(1e-12)
    assert found.energy == pytest.approx(end, rel=1e-6)
    assert found.milliseconds > 0


def test_a_race_has_everybody_at_the_same_end(step: WindowStep) -> None:
    race = window.race(step, "general")
    assert race.scipy_ms > race.ours_ms > 0
    with pytest.raises(UsageError, match="does not reach"):
        window.loosest(lambda _: 2.0, 1.0)
    assert window.loosest(lambda tolerance: 1.0 + tolerance / 100, 1.0) == pytest.approx(1e-4)


def test_a_shell_resists_everything_but_shifts() -> None:
    rest, mesh = surface_with_mesh(60)
    K, M = shell(rest, mesh.faces)
    assert abs(K - K.T).max() < 1e-12
    assert np.linalg.eigvalsh(K.toarray()).min() > -1e-9
    shift = np.tile([1.0, 2.0, -3.0], 60)
    assert np.abs(K @ shift).max() < 1e-10
    a, b, c = (rest.T[mesh.faces[:, k]] for k in range(3))
    assert M.diagonal().sum() / 3 == pytest.approx(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_flat_plate_bends_first() -> None:
    rest, mesh = surface_with_mesh(100)
    rest[2] = 0.0
    values, shapes = vibration_modes(rest, mesh.faces, 5)
    assert (values > 0).all()
    assert (np.diff(values) >= 0).all()
    across, within = np.abs(shapes[:, 2]).max(axis=1), np.abs(shapes[:, :2]).max(axis=(1, 2))
    assert (within < 1e-6 * across).sum() >= 4


def test_the_short_way_is_near_the_exact_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(basis, "COMPARED_POINTS", 700)
    for metric in basis.METRICS:
        assert basis.angle_degrees(metric, lambda _: None) < 5.0


def test_memory_is_that_of_a_process_of_its_own() -> None:
    size, peak_mb = apart(sum, [1, 2])
    assert size == 3
    assert 5 < peak_mb < 1000


def test_times_grow_as_they_do() -> None:
    assert growth([10, 100], [1.0, 10.0]) == pytest.approx(1.0)
    calls: list[str] = []
    least = least_s(lambda: calls.append("a"), lambda: calls.append("b"), budget_s=0.0)
    assert calls == ["a", "b"] * 2
    assert len(least) == 2


def test_tables_say_what_was_missed() -> None:
    ratios = {"scipy_over_ours": 250.0, "ceres_over_ours": None, "iteration_spread": 1.5}
    assert [(value, met) for _, value, _, met in rows(ratios)] == [("250×", True), ("1.5×", False)]
    table = markdown(ratios, "on a machine")
    assert "| 1.5× (missed) | ≤ 1.2× |" in table
    assert "on a machine" in table
    assert len({target.name for target in TARGETS}) == len(TARGETS)


def test_the_figure_is_drawn(tmp_path: Path) -> None:
    from app.bench.plot import draw

    timings = [window.Timing(p, 30, "general", 0.1, 0.1, 1.0, 3, 4.0) for p in (250, 828)]
    times = [basis.BasisTime(p, metric, 0.1, 0.1, 100.0, 1.0, None) for p in (56, 594) for metric in basis.METRICS]
    with (tmp_path / "bench.png").open("wb") as file:
        draw(file, "png", timings, [window.Race(828, 30, "general", 4.0, 400.0, None)], times)
    assert (tmp_path / "bench.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", ["bench.txt", "bench"])
def test_a_plot_that_is_no_picture_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="is no picture"):
        Bench(plot=Path(name))


def test_a_readme_without_a_place_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    from app.commands.bench import bench, with_table
    from app.terminal.progress import Progress

    readme = tmp_path / "README.md"
    readme.write_text("# nothing\n")
    with pytest.raises(UsageError, match="has no place for the table"):
        bench(Bench(readme=readme), Progress())
    readme.write_text("a\n<!-- bench: begin -->\nold\n<!-- bench: end -->\nb\n")
    text = with_table(Bench(readme=readme), "new\n")
    assert text == "a\n<!-- bench: begin -->\nnew\n<!-- bench: end -->\nb\n"


def test_what_is_measured_can_be_printed(capsys: pytest.CaptureFixture[str]) -> None:
    from dataclasses import asdict

    from app.bench.end_to_end import WholeRun
    from app.commands.bench import print_tables

    run = WholeRun("demo", 800, 100, 2.0, 3.0, 3.5, 2.5, 10.0, 12.0, 300.0)
    words = {
        "window": [asdict(window.Timing(828, 30, "general", 0.1, 0.1, 1.0, 3, 4.0))],
        "rivals": [asdict(window.Race(828, 30, "general", 4.0, 400.0, None))],
        "basis": [asdict(basis.BasisTime(56, "euclidean", 0.1, 0.1, 100.0, None, None))],
        "runs": [asdict(run)],
        "ratios": {"wall_over_bare_demo_800": 1.2},
        "ceres": False,
    }
    print_tables(words)
    printed = capsys.readouterr().out
    assert "pyceres is not installed" in printed
    assert "1.2×" in printed
    json.dumps(words)
