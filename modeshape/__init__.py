"""Moving 3-D meshes from videos of deforming surfaces.

    reconstruct(source, region=...)   a video's frames with their shapes, one by one, while it is read
    Reconstruction(size)              the same from points tracked elsewhere
    open_recording(path)              a recording of `modeshape run` as arrays

Points are rows: (P, 2) pixels and (P, 3) in camera axes, x right, y down, z forward, in pixels of the first frame. What
cannot be done is a ValueError that names it. Nothing is loaded before it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from modeshape.estimate import Estimate, Frame
    from modeshape.recording import Recording, open_recording
    from modeshape.tracks import Reconstruction
    from modeshape.video import reconstruct
    from reconstruction.settings import Settings

__version__ = "0.1.0"
__all__ = ["Estimate", "Frame", "Reconstruction", "Recording", "Settings", "open_recording", "reconstruct"]

MODULES = {
    "Estimate": "modeshape.estimate",
    "Frame": "modeshape.estimate",
    "Reconstruction": "modeshape.tracks",
    "Recording": "modeshape.recording",
    "Settings": "reconstruction.settings",
    "open_recording": "modeshape.recording",
    "reconstruct": "modeshape.video",
}


def __getattr__(name: str) -> object:
    if name not in MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *MODULES])
