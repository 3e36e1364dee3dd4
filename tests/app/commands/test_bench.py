"""`modeshape bench`: what is refused, and what is printed."""

import json
import re
from pathlib import Path

import pytest

from app.bench import basis, window
from app.options.bench import Bench
from app.terminal.errors import UsageError


def test_a_readme_without_a_place_is_refused_before_anything_is_measured(tmp_path: Path) -> None:
    from app.commands.bench import bench
    from app.terminal.progress import Progress

    readme = tmp_path / "README.md"
    readme.write_text("# nothing\n")
    with pytest.raises(UsageError, match="has no place for the table"):
        bench(Bench(readme=readme), Progress())


def test_what_is_measured_can_be_printed(capsys: pytest.CaptureFixture[str]) -> None:
    from dataclasses import asdict

    from app.bench.end_to_end import WholeRun
    from app.commands.bench import Benchmarks

    run = WholeRun(
        "demo", 800, 100, 2.0, 3.0, 3.5, 2.5, 4.0, 10.0, 12.0, {"median": 20.0}, {"track": 5.0}, 7.0, 300.0, 400.0, 0.3, 0.5
    )
    measured = Benchmarks(
        machine={},
        quick=True,
        window=[asdict(window.Timing(828, 30, "general", 0.1, 0.1, 1.0, 3, 4.0))],
        rivals=[asdict(window.Race(828, 30, "general", 4.0, 400.0, None))],
        basis=[asdict(basis.BasisTime(56, "euclidean", 0.1, 0.1, 100.0, None, None))],
        runs=[asdict(run)],
        ratios={"wall_over_bare_demo_800": 1.2},
        missed=[],
        ceres=False,
    )
    measured.print_table()
    printed = capsys.readouterr().out
    assert "pyceres is not installed" in printed
    assert "1.2×" in printed
    assert re.search(r"core ms track │ +5 │", printed)
    assert "…" not in printed  # all fits into a line
    json.loads(measured.as_json())
