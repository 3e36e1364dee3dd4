"""Our processes by fork: what they load takes seconds of processor time, and the tests make hundreds of runs.

python -m tests.app.forked FILE    loads it once, then forks whenever it is asked to over that socket
"""

import os
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from threading import Lock

from app.environment import environment

ROOT = Path(__file__).parents[2]


class Forked:
    """A forked process, as far as a process is used: it has ended when nobody holds the pipe's other end."""

    def __init__(self, lifeline: int) -> None:
        self._lifeline, self._beginning, self._ending = lifeline, Lock(), Lock()

    @property
    def pid(self) -> int:
        with self._beginning:
            return self._pid

    @cached_property
    def _pid(self) -> int:
        return int(os.read(self._lifeline, 16))

    def kill(self) -> None:
        if self._lifeline < 0:
            return
        with suppress(ProcessLookupError):
            os.kill(self.pid, signal.SIGKILL)

    def wait(self) -> None:
        with self._ending:
            if self._lifeline >= 0 and self.pid:
                while os.read(self._lifeline, 16):
                    pass
                os.close(self._lifeline)
            self._lifeline = -1


@cache
def loaded() -> socket.socket:
    """How to ask the process that forks; it ends with this one."""
    ours, theirs = socket.socketpair()
    with theirs:
        command = [sys.executable, "-m", "tests.app.forked", str(theirs.fileno())]
        subprocess.Popen(command, cwd=ROOT, env=environment(), pass_fds=[theirs.fileno()])
    return ours


def started(module: str, *files: int) -> Forked:
    """In place of `app.processes.child.started`."""
    lifeline, theirs = os.pipe()
    socket.send_fds(loaded(), [f"{module} {Path.cwd()}".encode()], [theirs, 2, *files])
    os.close(theirs)
    return Forked(lifeline)


def main() -> None:
    from app.figures import modes_figure  # noqa: F401
    from app.pipeline.stages import maps, tracking_process  # noqa: F401
    from app.playback.reading import chunks, file  # noqa: F401
    from app.recording import process, recording  # noqa: F401
    from reconstruction.mapping import mapper  # noqa: F401

    asked = socket.socket(fileno=int(sys.argv[1]))
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for the forks
    while True:
        words, files, _, _ = socket.recv_fds(asked, 4096, 8)
        if not files:
            os._exit(0)
        lifeline, errors, *theirs = files
        if not os.fork():
            module, folder = words.decode().split(" ", 1)
            asked.close()
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            os.setpgid(0, 0)
            os.chdir(folder)
            os.write(lifeline, str(os.getpid()).encode())
            for output in (1, 2):
                os.dup2(errors, output)
            sys.argv[1:] = map(str, theirs)
            import_module(module).main()
        for number in files:
            os.close(number)


if __name__ == "__main__":
    main()
