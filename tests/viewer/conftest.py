"""A real Rerun viewer without a screen; it needs a Vulkan driver, a software one will do."""

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
import rerun_cli
from rerun.experimental import ViewerClient

START_S = 30.0


@dataclass(frozen=True)
class Viewer:
    """A running viewer: its address, what asks it, and its process."""

    address: str
    client: ViewerClient
    process: subprocess.Popen[bytes]


@pytest.fixture(scope="module")
def viewer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Viewer]:
    with headless_viewer(tmp_path_factory.mktemp("viewer")) as viewer:
        yield viewer


@pytest.fixture
def mortal_viewer(tmp_path: Path) -> Iterator[Viewer]:
    """One that a test may end."""
    with headless_viewer(tmp_path) as viewer:
        yield viewer


@contextmanager
def headless_viewer(folder: Path, size: tuple[int, int] = (1600, 1000)) -> Iterator[Viewer]:
    """Skips the test where no viewer runs, unless CI=true; its output goes to a file in the folder."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    # The binary itself: the `rerun` on PATH is a launcher that would leave it running.
    program = Path(rerun_cli.__file__).with_name("rerun")
    options = ["--headless", "--window-size", f"{size[0]}x{size[1]}", "--hide-welcome-screen", "--bind", "127.0.0.1"]
    log = folder / "viewer.txt"
    with log.open("w") as output:
        process = subprocess.Popen(
            [program, *options, "--port", str(port)],
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        client = connected(process, port)
        if client is None:
            reason = "the headless viewer does not start: is there a Vulkan driver (mesa-vulkan-drivers)?"
            pytest.fail(f"{reason}\n{log.read_text()}") if os.environ.get("CI") == "true" else pytest.skip(reason)
        yield Viewer(f"127.0.0.1:{port}", client, process)
    finally:
        process.kill()
        process.wait()


def connected(process: subprocess.Popen[bytes], port: int) -> ViewerClient | None:
    """A client, once the viewer answers; None if it ends or never does."""
    end = time.monotonic() + START_S
    while time.monotonic() < end and process.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
            client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            client.take_screenshot()
        except OSError:
            time.sleep(0.1)
        else:
            return client
    return None
