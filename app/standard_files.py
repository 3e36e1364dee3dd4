"""Files that every process has open."""

import os


def hold() -> None:
    """Open what is closed of standard input, output and error, so that no other file takes its number."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
