"""Imports go one way, from room to room; rooms and files stay small; the command line loads nothing heavy."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("modeshape", "app", "tracking", "reconstruction")
MOST_LINES, MOST_MODULES = 250, 12

# What a room may import besides itself and what its package shares, which are the files right in it; app's rooms also
# everything of `tracking` and `reconstruction`.
SHOWN = {"app.files", "app.options", "app.terminal"}
WORKED = SHOWN | {"app.figures", "app.painting", "app.pipeline", "app.playback", "app.recording"}
MEASURED = WORKED | {"app.demo", "app.rivals"}
ARROWS = {
    "app.shared": set(),
    "app.terminal": set(),
    "app.files": {"app.terminal"},
    "app.processes": {"app.terminal"},
    "app.options": {"app.files", "app.terminal"},
    "app.painting": SHOWN,
    "app.recording": SHOWN | {"app.processes"},
    "app.figures": {"app.recording"},
    "app.playback": SHOWN | {"app.figures", "app.processes", "app.recording"},
    "app.pipeline": SHOWN | {"app.painting", "app.processes", "app.recording"},
    "app.picking": {"app.files", "app.terminal"},
    "app.demo": {"app.files", "app.terminal"},
    "app.synthetic": {"app.demo", "app.painting"},
    "app.footage": {"app.files"},
    "app.rivals": set(),
    "app.bench": MEASURED,
    "app.reproduce": MEASURED | {"app.footage", "app.synthetic"},
    "app.commands": MEASURED | {"app.bench", "app.picking", "app.reproduce"},
    "tracking": set(),
    "reconstruction.shared": set(),
    "reconstruction.basis": set(),
    "reconstruction.window": {"reconstruction.basis"},
    "reconstruction.mapping": {"reconstruction.basis", "reconstruction.window"},
    "reconstruction.evaluation": {"reconstruction.basis"},
    "reconstruction.online": {"reconstruction.basis", "reconstruction.window", "reconstruction.mapping"},
    "reconstruction.unknown_camera": {"reconstruction.mapping"},
    "modeshape": WORKED | {"app.shared", "app.commands"},
}
TERMINAL_AND_VIEWER = {"rerun", "rerun_cli", "tyro", "rich"}
FOREIGN = {"tracking": TERMINAL_AND_VIEWER, "reconstruction": TERMINAL_AND_VIEWER | {"cv2"}}
HEAVY = {"cv2", "rerun", "scipy", "numpy", "trimesh", "pyarrow"}


def modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Line and full name of every import in a file, wherever it stands; `from a import b` is an import of a.b."""
    package = path.relative_to(ROOT).parent.parts
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = [*package[: len(package) - node.level + 1]] if node.level else []
            start = ".".join([*base, *([node.module] if node.module else [])])
            yield from ((node.lineno, f"{start}.{alias.name}") for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("__import__", "importlib.import_module"):
            yield node.lineno, ast.literal_eval(node.args[0])


def full_name(path: Path) -> str:
    """Of a module of ours, as it is imported."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def room(module: str) -> str:
    """The room of a module of ours, given by its full name or by a name in it; of others their package."""
    package, *inner = module.split(".")
    if package not in ("app", "reconstruction") or not inner:
        return package
    if (ROOT / package / inner[0]).is_dir() or f"{package}.{inner[0]}" in ARROWS:
        return f"{package}.{inner[0]}"
    return f"{package}.shared" if (ROOT / package / f"{inner[0]}.py").is_file() else package


def strangers(path: Path) -> Iterator[str]:
    """What a file imports and may not."""
    package = path.relative_to(ROOT).parts[0]
    here = room(full_name(path))
    for line, name in imported(path):
        there = room(name)
        if there.split(".")[0] not in PACKAGES:
            allowed = there not in FOREIGN.get(package, set())
        elif there in (here, package, f"{package}.shared"):
            allowed = True
        elif package in ("app", "modeshape") and there.split(".")[0] in ("tracking", "reconstruction"):
            allowed = here != "app.terminal"
        else:
            allowed = there in ARROWS.get(here, set())
        if not allowed:
            yield f"{path.relative_to(ROOT)}:{line} imports {name}"


def test_every_room_has_its_arrows() -> None:
    rooms = {room(full_name(path)) for package in PACKAGES for path in modules(package)}
    assert rooms - {"app", "reconstruction"} == ARROWS.keys()


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_go_one_way(package: str) -> None:
    assert modules(package)
    assert [wrong for path in modules(package) for wrong in strangers(path)] == []


def test_the_rule_sees_every_form_of_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[__name__], "ROOT", tmp_path)
    path = tmp_path / "reconstruction" / "basis" / "x.py"
    path.parent.mkdir(parents=True)
    (tmp_path / "reconstruction" / "window").mkdir()
    path.write_text(
        "import cv2\nimport app.commands.cli as c\nfrom tracking.video import Video\nfrom . import mesh\n"
        "from ..window import solver\nfrom reconstruction import window, ReconstructionError\n"
        "def f():\n    import rich.progress\n    __import__('tyro')\n"
    )
    told = [line.partition(" imports ")[2] for line in strangers(path)]
    assert sorted(told) == [
        "app.commands.cli", "cv2", "reconstruction.window", "reconstruction.window.solver", "rich.progress",
        "tracking.video.Video", "tyro",
    ]  # fmt: skip


def test_files_are_short_and_rooms_small() -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for package in (*PACKAGES, "tests", "docs", "examples")
        for path in modules(package)
        if (lines := len(path.read_text().splitlines())) > MOST_LINES
    }
    assert long == {}
    folders = [path.parent for package in PACKAGES for path in modules(package)]
    crowded = {
        str(folder.relative_to(ROOT)): count
        for folder in set(folders)
        if (count := sum(path.name != "__init__.py" for path in folder.glob("*.py"))) > MOST_MODULES
    }
    assert crowded == {}


def test_the_program_does_nothing_when_it_is_imported() -> None:
    assert list(imported(ROOT / "app" / "__init__.py")) == []


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
    every = "; ".join(f"import {full_name(path)}" for path in modules(package))
    assert loaded_by(every) & (absent | {"app"}) == set()


def test_help_names_the_commands() -> None:
    command = [sys.executable, "-m", "modeshape", "--help"]
    environment = os.environ | {"COLUMNS": "100"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, env=environment)
    for word in ("run", "evaluate", "demo"):
        assert word in done.stdout
