"""Finding or starting the viewer that a recording is streamed to."""

import socket
import subprocess
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING
from urllib.parse import quote, urlsplit

import rerun_cli  # type: ignore[import-untyped]

from app.terminal.errors import UsageError

if TYPE_CHECKING:
    from app.options.run import Output  # the process that writes recordings needs no command line

PORT, WEB_PORT = 9876, 9090
TIMEOUT_S = 1.0
STARTED_S = 0.5  # after which one without a screen has ended
START_S = 15.0  # until a viewer answers


def running_viewer(address: str) -> str:
    """The URL of a running viewer, from `host`, `host:port` or a rerun+http URL.

    Raises:
        UsageError: not an address, or nobody listens there.
    """
    parts = urlsplit(address if "://" in address else f"rerun+http://{address}")
    try:
        host, port = parts.hostname, parts.port or PORT
    except ValueError:
        host = None
    if host is None or not parts.scheme.startswith("rerun"):
        raise UsageError(f"--connect {address} is no viewer's address: give host:port, like 127.0.0.1:{PORT}")
    if not listening(host, port):  # Rerun itself would wait 5 seconds, and go on without a viewer
        raise UsageError(f"no viewer answers at {host}:{port}: start one with `rerun`, or use --view")
    return f"{parts.scheme}://{host}:{port}/proxy"


def opened_viewer(path: Path | None, output: "Output", log: Callable[[str], None]) -> str | None:
    """The URL of the viewer that a run is to be watched in, which is started if it does not run; None without one.

    Args:
        path: where the run is recorded; None: nowhere.
        output: says what is wanted.
        log: where to report.

    Raises:
        UsageError: there is none, and no file to look at later.
    """
    if output.connect:
        return running_viewer(output.connect)
    if output.serve:
        url = spawned_viewer(log, in_browser=True)
        log(f"watch it in a browser of this machine: http://127.0.0.1:{WEB_PORT}/?url={quote(url, safe='')}")
        return url
    if not output.view:
        return None
    try:
        return spawned_viewer(log)
    except UsageError as error:
        if path is None:
            raise
        log(f"{error}: {path}")
        return None


def answers(url: str) -> bool:
    """Whether a viewer listens at its URL."""
    parts = urlsplit(url)
    return listening(str(parts.hostname), parts.port or PORT)


def spawned_viewer(log: Callable[[str], None], *, in_browser: bool = False) -> str:
    """The URL of a viewer on this machine, started unless one is running already, in a window or for a browser.

    `log` is told of one that is running, and of one without a window, which nobody would find afterwards.

    Raises:
        UsageError: it does not start.
    """
    if listening("127.0.0.1", PORT):
        log(f"a viewer runs at 127.0.0.1:{PORT} already, maybe in a browser: it is shown there")
    else:
        how = ["--serve-web", "--web-viewer-port", str(WEB_PORT)] if in_browser else ["--expect-data-soon"]
        program = Path(rerun_cli.__file__).with_name("rerun")  # of this very version, whatever is on PATH
        # Not by rr.spawn: it would be open to the whole network.
        command = [str(program), "--bind", "127.0.0.1", "--port", str(PORT), "--hide-welcome-screen", *how]
        quiet = subprocess.DEVNULL
        try:
            viewer = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
        except OSError as error:
            raise UsageError(f"--view: the viewer does not start: {error.strerror}") from error
        patience = monotonic() + START_S
        while not listening("127.0.0.1", PORT):
            if viewer.poll() is not None or monotonic() > patience:
                raise UsageError("--view: the viewer does not start (is there a screen?); open the file later")
            sleep(0.05)
        sleep(STARTED_S)
        if viewer.poll() is not None:
            raise UsageError("--view: the viewer does not stay (is there a screen?); open the file later")
        if in_browser:
            log(f"the viewer goes on when the run has ended: kill {viewer.pid} ends it")
    return f"rerun+http://127.0.0.1:{PORT}/proxy"


def listening(host: str, port: int) -> bool:
    """Whether somebody accepts connections there."""
    try:
        socket.create_connection((host, port), timeout=TIMEOUT_S).close()
    except OSError:
        return False
    return True
