"""Starting a viewer: for this machine only, and told when it does not start."""

import socket
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.options.run import Output
from app.recording import viewer
from app.terminal.errors import UsageError

LISTENS = """
import socket, sys, time
options = dict(zip(sys.argv[1::2], sys.argv[2::2]))
with socket.create_server((options["--bind"], int(options["--port"]))) as server:
    open(sys.argv[0] + ".bind", "w").write(options["--bind"])
    server.settimeout(5)
    for _ in range(20):
        server.accept()[0].close()
"""


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Where the viewer's program is looked for; and a free port."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        monkeypatch.setattr(viewer, "PORT", free.getsockname()[1])
    monkeypatch.setattr(viewer, "rerun_cli", SimpleNamespace(__file__=str(tmp_path / "rerun_cli.py")))
    return tmp_path / "rerun"


def test_it_listens_on_this_machine_only(program: Path) -> None:
    program.write_text(f"#!{sys.executable}\n{LISTENS}")
    program.chmod(0o755)
    told: list[str] = []
    for _ in range(2):
        assert viewer.spawned_viewer(told.append) == f"rerun+http://127.0.0.1:{viewer.PORT}/proxy"
    assert ["already" in line for line in told] == [True]  # the second time it runs
    assert program.with_name("rerun.bind").read_text() == "127.0.0.1"


def test_in_a_browser_the_address_is_told(program: Path) -> None:
    program.write_text(
        f"#!{sys.executable}\n{LISTENS.replace('sys.argv[1::2], sys.argv[2::2]', 'sys.argv[1:], sys.argv[2:]')}"
    )
    program.chmod(0o755)
    told: list[str] = []
    url = viewer.opened_viewer(None, Output(serve=True), told.append)
    assert url == f"rerun+http://127.0.0.1:{viewer.PORT}/proxy"
    assert viewer.answers(url)
    stays, line = told
    assert "goes on when the run has ended" in stays
    assert f"http://127.0.0.1:{viewer.WEB_PORT}/?url=rerun%2Bhttp" in line


def test_without_a_screen_a_run_is_recorded_all_the_same(program: Path) -> None:
    program.write_text(f"#!{sys.executable}\nraise SystemExit(1)\n")
    program.chmod(0o755)
    told: list[str] = []
    assert viewer.opened_viewer(Path("run.rrd"), Output(view=True), told.append) is None
    [line] = told
    assert "is there a screen" in line
    assert line.endswith("run.rrd")
    with pytest.raises(UsageError, match="does not start"):
        viewer.opened_viewer(None, Output(view=True), told.append)


@pytest.mark.parametrize("text", [None, f"#!{sys.executable}\nraise SystemExit(1)\n"])
def test_one_that_does_not_start_is_told(program: Path, text: str | None) -> None:
    if text is not None:
        program.write_text(text)
        program.chmod(0o755)
    with pytest.raises(UsageError, match="--view: the viewer does not start"):
        viewer.spawned_viewer(print)
