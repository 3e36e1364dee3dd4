"""Imports go one way, and the command line answers before anything heavy is loaded."""

import ast
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TERMINAL_AND_VIEWER = {"rerun", "rerun_cli", "tyro", "rich"}
FORBIDDEN = {
    "tracking": {"app", "reconstruction"} | TERMINAL_AND_VIEWER,
    "reconstruction": {"app", "tracking", "cv2"} | TERMINAL_AND_VIEWER,
}
HEAVY = {"cv2", "rerun", "scipy", "numpy", "trimesh", "pyarrow"}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Line and top-level package of every import in a file, wherever it stands."""
    package = path.relative_to(ROOT).parts[0]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name.split(".")[0]) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.lineno, package if node.level else (node.module or "").split(".")[0]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("__import__", "importlib.import_module"):
            yield node.lineno, ast.literal_eval(node.args[0]).split(".")[0]


@pytest.mark.parametrize("package", FORBIDDEN)
def test_imports_go_one_way(package: str) -> None:
    assert modules(package)
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in modules(package)
        for line, name in imported(path)
        if name in FORBIDDEN[package]
    ]
    assert wrong == []


def test_the_rule_sees_every_form_of_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    path = tmp_path / "reconstruction" / "x.py"
    path.parent.mkdir()
    path.write_text(
        "import cv2\nimport app.commands.cli as c\nfrom tracking.video import Video\nfrom . import mesh\n"
        "def f():\n    import rich.progress\n    __import__('tyro')\n"
    )
    assert {name for _, name in imported(path)} == {"cv2", "app", "tracking", "reconstruction", "rich", "tyro"}


def loaded_by(statement: str) -> set[str]:
    """Top-level packages in memory after a statement in a fresh interpreter."""
    program = f"import sys\n{statement}\nprint(*{{name.split('.')[0] for name in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    return set(done.stdout.split())


@pytest.mark.parametrize("module", ["modeshape", "app.options.run", "app.commands.cli"])
def test_the_command_line_loads_nothing_heavy(module: str) -> None:
    assert loaded_by(f"import {module}") & HEAVY == set()


@pytest.mark.parametrize(
    ("package", "absent"),
    [("tracking", {"scipy", "rerun", "reconstruction"}), ("reconstruction", {"cv2", "rerun", "tracking"})],
)
def test_a_package_can_be_used_without_the_others(package: str, absent: set[str]) -> None:
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in modules(package)]
    every = "; ".join(f"import {name.removesuffix('.__init__')}" for name in names)
    assert loaded_by(every) & (absent | {"app"}) == set()


def test_help_is_instant() -> None:
    command = [sys.executable, "-m", "modeshape", "--help"]
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        done = subprocess.run(
            command, cwd=ROOT, capture_output=True, text=True, check=True, env=os.environ | {"COLUMNS": "100"}
        )
        seconds.append(time.perf_counter() - started)
        for word in ("run", "evaluate", "demo"):
            assert word in done.stdout
    assert min(seconds) < 0.5
