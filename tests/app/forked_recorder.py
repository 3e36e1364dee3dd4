"""Recording processes by fork: what they load takes 2 s of processor time, and the tests make hundreds of runs.

python -m tests.app.forked_recorder FILE    loads it once, then forks whenever it is asked to over that socket
"""

import os
import signal
import socket
import subprocess
import sys
from functools import cache
from pathlib import Path

from app.recording import process
from app.recording.environment import environment

ROOT = Path(__file__).parents[2]


class Forked:
    """A forked process, as far as `RecordingProcess` knows one: it has ended when nobody holds the pipe's other end."""

    def __init__(self, lifeline: int) -> None:
        self._lifeline = lifeline

    def wait(self) -> None:
        os.read(self._lifeline, 1)
        os.close(self._lifeline)


@cache
def loaded() -> socket.socket:
    """How to ask the process that forks; it ends with this one."""
    ours, theirs = socket.socketpair()
    with theirs:
        command = [sys.executable, "-m", "tests.app.forked_recorder", str(theirs.fileno())]
        env = environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        subprocess.Popen(command, cwd=ROOT, env=env, pass_fds=[theirs.fileno()])
    return ours


def started(file: int) -> Forked:
    """In place of `app.recording.process.started`."""
    lifeline, theirs = os.pipe()
    socket.send_fds(loaded(), [str(Path.cwd()).encode()], [file, theirs, 2])
    os.close(theirs)
    return Forked(lifeline)


def main() -> None:
    from app.recording import modes_figure, recording  # noqa: F401

    asked = socket.socket(fileno=int(sys.argv[1]))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for the forks
    while True:
        folder, files, _, _ = socket.recv_fds(asked, 4096, 3)
        if not files:
            os._exit(0)
        if not os.fork():
            asked.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            os.setsid()
            os.chdir(folder)
            for output in (1, 2):
                os.dup2(files[2], output)
            sys.argv[1] = str(files[0])
            process.main()
        for file in files:
            os.close(file)


if __name__ == "__main__":
    main()
