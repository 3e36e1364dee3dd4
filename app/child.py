"""Processes of our own, each with a connection to the one that began it."""

import os
import subprocess
import sys
from multiprocessing import Pipe
from multiprocessing.connection import Connection

from app.environment import environment


def child(module: str) -> tuple["subprocess.Popen[bytes]", Connection]:
    """A process that runs a module of ours, and the connection to it; `connection_to_parent` is its other end.

    Not one of multiprocessing's: those run the user's own script again.
    """
    ours, theirs = Pipe()
    with theirs:
        return started(module, theirs.fileno()), ours


def started(module: str, file: int) -> "subprocess.Popen[bytes]":
    """The process, which talks over an open file, by its number."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", module, str(file)],  # -P: not the user's modules
        env=environment() | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        stdin=subprocess.DEVNULL,
        stdout=2,  # stderr: stdout is for the summary
        pass_fds=[file],
        start_new_session=True,  # Ctrl-C ends the run, which then tells what is left to do
    )


def connection_to_parent() -> Connection:
    """The connection of a process that `child` began."""
    os.set_inheritable(int(sys.argv[1]), False)
    return Connection(int(sys.argv[1]))
