"""What Rerun reads from the environment when it is loaded; for the command, and for the processes that use Rerun."""

import os

ENVIRONMENT = {
    "RERUN_ANALYTICS": "0",
    "RUST_LOG": "off",  # what goes wrong is said by us, once, without a time stamp
    "MIMALLOC_PURGE_DELAY": "0",  # its memory goes back to the system at once: a long run stays small
}


def environment() -> dict[str, str]:
    """The process's environment, completed; what a person has set stays."""
    return ENVIRONMENT | os.environ
