"""The memory of this process: what the C library keeps when it is given back."""

from contextlib import suppress
from ctypes import CDLL
from functools import cache
from threading import Thread
from time import sleep

KEPT_BYTES = {-1: 32 * 2**20, -3: 32 * 2**20}  # by parameter of glibc's mallopt: M_TRIM_THRESHOLD, M_MMAP_THRESHOLD
TRIMMED_S = 10.0  # between two times at which all that is kept goes back: what was needed once must not stay for ever


@cache  # one thread is enough
def keep_memory() -> None:
    """Keep the memory of pictures and arrays for the next ones, for a while: to get it cleared by the system takes time."""
    with suppress(OSError, AttributeError):  # another C library
        library = CDLL(None)
        for parameter, most in KEPT_BYTES.items():
            library.mallopt(parameter, most)
        Thread(target=trim, args=(library,), name="memory", daemon=True).start()


def trim(library: CDLL) -> None:
    """Give back what is kept, again and again."""
    while True:
        sleep(TRIMMED_S)
        library.malloc_trim(0)
