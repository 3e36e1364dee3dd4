"""Processes of our own, each with a connection to the one that began it."""

import os
import signal
import subprocess
import sys
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from tempfile import TemporaryFile

from app.environment import environment
from app.memory import keep_memory

NICEST = 19  # takes what all others leave


def child(module: str, *files: int, nice: int = 0) -> tuple["subprocess.Popen[bytes]", Connection]:
    """A process that runs a module of ours, and the connection to it; `connection_to_parent` is its other end.

    Not one of multiprocessing's: those run the user's own script again.

    Args:
        module: its name.
        files: open files that the process gets, too, by their numbers, which are its further arguments.
        nice: how much nicer it is, to others of ours, than this one.
    """
    ours, theirs = Pipe()
    with theirs:
        process = started(module, theirs.fileno(), *files)
    if nice:
        os.setpriority(os.PRIO_PROCESS, process.pid, os.getpriority(os.PRIO_PROCESS, process.pid) + nice)
    return process, ours


def started(module: str, *files: int) -> "subprocess.Popen[bytes]":
    """The process, with open files, by their numbers, which are its arguments."""
    return subprocess.Popen(
        [sys.executable, "-P", "-W", "ignore", "-m", module, *map(str, files)],  # -P: not the user's modules
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=2,  # stderr: stdout is for the summary
        pass_fds=files,
        # Ctrl-C ends the run, which then tells what is left to do. Sessions of their own would do, too, but to each of
        # those Linux gives as much as to the run's, however nice they are.
        process_group=0,
    )


def connection_to_parent() -> Connection:
    """The connection of a process that `child` began; the process keeps its memory from now on."""
    keep_memory()
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # what it says on the terminal does not stop it, whatever `stty` says
    return Connection(inherited_file(1))


def inherited_file(place: int) -> int:
    """The number of an open file that `started` gave, by its place among the arguments; our own children lack it."""
    number = int(sys.argv[place])
    os.set_inheritable(number, False)
    return number


def shared_file() -> int:
    """A file without a name, to be passed on by its number: nothing of it is left when the last process has ended."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("modeshape")
    with TemporaryFile() as file:
        return os.dup(file.fileno())
