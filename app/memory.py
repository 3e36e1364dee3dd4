"""The memory of this process: what the C library keeps when it is given back."""

from contextlib import suppress
from ctypes import CDLL

KEPT_BYTES = {-1: 16 * 2**20, -3: 32 * 2**20}  # by parameter of glibc's mallopt: M_TRIM_THRESHOLD, M_MMAP_THRESHOLD


def keep_memory() -> None:
    """Keep the memory of pictures and arrays for the next ones: to get it cleared by the system takes time."""
    with suppress(OSError, AttributeError):  # another C library
        mallopt = CDLL(None).mallopt
        for parameter, most in KEPT_BYTES.items():
            mallopt(parameter, most)
