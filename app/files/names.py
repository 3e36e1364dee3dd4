"""Names of files that do not exist yet."""

import errno
import socket
from collections.abc import Iterator
from hashlib import sha256
from itertools import count
from pathlib import Path

RECORDINGS = Path("recordings")

HELD: dict[Path, socket.socket] = {}  # by what they hold, until this process ends


def free_name(folder: Path, source: str) -> Path:
    """A recording's path named after its source that no other run has, or is going to write: NAME.rrd, NAME-2.rrd, …"""
    path = folder / f"{'camera' if source.isdigit() else ''}{stem(source)}.rrd"
    return next(one for one in numbered(path) if not one.exists() and held(one))


def stem(source: str) -> str:
    """What is named after a video file, an image pattern or a URL."""
    return Path(source.split("?")[0]).stem.replace("%", "") or "video"


def beside(path: Path, what: str, *, overwrite: bool) -> Path:
    """NAME-WHAT beside a file NAME, numbered if that exists and may not be replaced."""
    other = path.with_name(f"{path.stem}-{what}{path.suffix}")
    return other if overwrite else free(other)


def free(path: Path) -> Path:
    """The first of NAME, NAME-2, … that does not exist."""
    return next(one for one in numbered(path) if not one.exists())


def numbered(path: Path) -> Iterator[Path]:
    """NAME, NAME-2, …"""
    return (path.with_name(f"{path.stem}{f'-{n}' if n > 1 else ''}{path.suffix}") for n in count(1))


def held(path: Path) -> bool:
    """Take a name for what this process will write later; whether no other process has taken it.

    A socket has the name, where sockets need not be files: nothing is left of it, however the process ends.
    """
    if path.resolve() in HELD:
        return True
    one = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        one.bind("\0modeshape " + sha256(bytes(path.resolve())).hexdigest())
    except (OSError, ValueError) as error:
        one.close()
        return getattr(error, "errno", None) != errno.EADDRINUSE
    HELD[path.resolve()] = one
    return True
