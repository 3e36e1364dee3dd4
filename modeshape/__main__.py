"""The command: `modeshape`, or `python -m modeshape`."""

import atexit
import os
import sys
from pathlib import Path
from typing import NoReturn


def main() -> NoReturn:
    """Carry out what the command line asks for."""
    codes: list[object] = []
    atexit.register(leave, codes)  # before all others, so it is called after them
    try:
        begin()
    except SystemExit as stop:
        codes.append(stop.code)
        raise
    except KeyboardInterrupt:  # before anything was begun
        codes.append(130)
        sys.exit(130)


def begin() -> NoReturn:
    """Import what the command needs, while its other processes begin, and carry it out."""
    try:
        isolate()
    except FileNotFoundError:
        sys.stderr.write("error: the current folder is gone: change to another\n")
        sys.exit(2)
    from app.environment import environment
    from app.standard_files import hold

    hold()
    os.environ.update(environment())
    if sys.argv[1:2] == ["run"] and not {"-h", "--help", "--help-all"} & set(sys.argv):
        from app.pipeline.stages.launched import WAITING, Launched

        WAITING.append(Launched())
    from app.commands.cli import main as run

    run()


def leave(codes: list[object]) -> None:
    """End with the exit code that is known, if any: what Python would tidy up in a sixth of a second, the system does."""
    for code in codes:
        if isinstance(code, int):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)


def isolate() -> None:
    """Import nothing from the current folder, here or in child processes: it may hold an `app/` or a `numpy.py`.

    Its place in `sys.path` and PYTHONPATH is dropped, unless the program itself lies there.
    """
    here, home = Path.cwd(), Path(__file__).parents[1]

    def elsewhere(paths: list[str]) -> list[str]:
        return [path for path in paths if here == home or Path(path).resolve() != here]

    os.environ["PYTHONSAFEPATH"] = "1"
    sys.path[:] = elsewhere(sys.path)
    if "PYTHONPATH" in os.environ:
        os.environ["PYTHONPATH"] = os.pathsep.join(elsewhere(os.environ["PYTHONPATH"].split(os.pathsep)))


if __name__ == "__main__":
    main()
