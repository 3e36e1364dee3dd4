"""Memory that is free goes back to the system: the C library would keep what lies between long-lived pieces."""

import ctypes
import sys
from collections.abc import Callable
from functools import cache

EVERY_FRAMES = 250


@cache
def _trim() -> Callable[[int], int] | None:
    if not sys.platform.startswith("linux"):
        return None
    return getattr(ctypes.CDLL(None), "malloc_trim", None)  # not in every C library


def give_back() -> None:
    """Return free memory to the system, if there is a way; takes about a millisecond."""
    trim = _trim()
    if trim is not None:
        trim(0)
