"""Everything a person touches: command line, session, recording, demo."""

import os

# Read when Rerun is loaded.
os.environ.setdefault("RUST_LOG", "off")  # what goes wrong is said by us, once, without a time stamp
os.environ.setdefault("MIMALLOC_PURGE_DELAY", "0")  # its memory goes back to the system at once: a long run stays small
