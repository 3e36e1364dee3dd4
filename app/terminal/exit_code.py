"""What the exit codes of the commands mean."""

from enum import IntEnum


class ExitCode(IntEnum):
    """How a command ended."""

    DONE = 0
    SOME_FAILED = 1
    BAD_INPUT = 2
    OUR_MISTAKE = 70
    INTERRUPTED = 130
