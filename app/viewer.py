"""Finding or starting the viewer that a recording is streamed to."""

import socket
from pathlib import Path
from urllib.parse import urlsplit

import rerun as rr
import rerun_cli  # type: ignore[import-untyped]

from app.errors import UsageError

PORT = 9876
TIMEOUT_S = 1.0


def running_viewer(address: str) -> str:
    """The URL of a running viewer, from `host`, `host:port` or a rerun+http URL.

    Raises:
        UsageError: not an address, or nobody listens there.
    """
    url = address if "://" in address else f"rerun+http://{address}/proxy"
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port or PORT
    except ValueError:
        host = None
    if host is None or not parts.scheme.startswith("rerun"):
        raise UsageError(f"--connect {address} is no viewer's address: give host:port, for instance 127.0.0.1:{PORT}")
    try:  # Rerun itself would wait 5 seconds, and then go on without a viewer
        socket.create_connection((host, port), timeout=TIMEOUT_S).close()
    except OSError as error:
        raise UsageError(f"no Rerun viewer answers at {host}:{port}: start one with `rerun`, or use --view") from error
    return f"{parts.scheme}://{parts.netloc if parts.port else f'{parts.netloc}:{port}'}{parts.path or '/proxy'}"


def spawned_viewer() -> str:
    """The URL of a viewer on this machine, started unless one is running already.

    Raises:
        UsageError: it does not start.
    """
    program = Path(rerun_cli.__file__).with_name("rerun")  # of this very version, whatever is on PATH
    try:
        rr.spawn(port=PORT, connect=False, hide_welcome_screen=True, executable_path=str(program))
    except RuntimeError as error:
        raise UsageError(f"the viewer does not start ({error}): leave out --view and open the file later") from error
    return f"rerun+http://127.0.0.1:{PORT}/proxy"
