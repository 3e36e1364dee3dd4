"""What libraries read from the environment when they are loaded; for the command and its processes."""

import os

ENVIRONMENT = {
    "RERUN_ANALYTICS": "0",
    "RUST_LOG": "off",  # what goes wrong is said by us, once, without a time stamp
    "OPENCV_LOG_LEVEL": "SILENT",
    "OPENCV_FFMPEG_LOGLEVEL": "-8",  # nothing, too
    "MIMALLOC_PURGE_DELAY": "0",  # its memory goes back to the system at once: a long run stays small
}
ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}  # the matrices are small: more would wait for each other


def environment() -> dict[str, str]:
    """The process's environment, completed; what a person has set stays, but for threads of linear algebra."""
    return ENVIRONMENT | os.environ | ONE_THREAD
