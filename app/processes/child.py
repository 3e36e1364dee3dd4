"""Processes of our own, each with a connection to the one that began it."""

import os
import subprocess
import sys
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from tempfile import TemporaryFile

from app.environment import environment
from app.memory import keep_memory

NICE, NICEST = 5, 19  # of processes that frames do not wait for; the nicest takes what all others leave


def child(module: str, *files: int) -> tuple["subprocess.Popen[bytes]", Connection]:
    """A process that runs a module of ours, and the connection to it; `connection_to_parent` is its other end.

    Not one of multiprocessing's: those run the user's own script again.

    Args:
        module: its name.
        files: open files that the process gets, too, by their numbers, which are its further arguments.
    """
    ours, theirs = Pipe()
    with theirs:
        return started(module, theirs.fileno(), *files), ours


def started(module: str, *files: int) -> "subprocess.Popen[bytes]":
    """The process, with open files, by their numbers, which are its arguments."""
    return subprocess.Popen(
        [sys.executable, "-P", "-W", "ignore", "-m", module, *map(str, files)],  # -P: not the user's modules
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=2,  # stderr: stdout is for the summary
        pass_fds=files,
        start_new_session=True,  # Ctrl-C ends the run, which then tells what is left to do
    )


def connection_to_parent(*, nice: int = 0) -> Connection:
    """The connection of a process that `child` began; the process keeps its memory, and is so nice, from now on."""
    keep_memory()
    os.nice(nice)
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
