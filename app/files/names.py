"""Names of files that do not exist yet."""

from itertools import count
from pathlib import Path

RECORDINGS = Path("recordings")


def free_name(folder: Path, source: str) -> Path:
    """A recording's path named after its source that does not exist yet: NAME.rrd, NAME-2.rrd, …"""
    return free(folder / f"{'camera' if source.isdigit() else ''}{stem(source)}.rrd")


def stem(source: str) -> str:
    """What is named after a video file, an image pattern or a URL."""
    return Path(source.split("?")[0]).stem.replace("%", "") or "video"


def beside(path: Path, what: str, *, overwrite: bool) -> Path:
    """NAME-WHAT beside a file NAME, numbered if that exists and may not be replaced."""
    other = path.with_name(f"{path.stem}-{what}{path.suffix}")
    return other if overwrite else free(other)


def free(path: Path) -> Path:
    """The first of NAME, NAME-2, … that does not exist."""
    numbered = (path.with_name(f"{path.stem}{f'-{n}' if n > 1 else ''}{path.suffix}") for n in count(1))
    return next(one for one in numbered if not one.exists())
