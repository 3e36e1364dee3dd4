"""Exports of a small recording."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.commands.export import FOLDERS, export
from app.options.export import Export
from app.terminal.progress import Progress

FRAMES = 6


def exported(recording: Path, kind: str, folder: Path, **options: object) -> Path:
    out = folder / (f"out_{kind}" if kind in FOLDERS else f"out.{kind}")
    written = export(Export(recording, format=kind, out=out, **options), Progress())  # type: ignore[arg-type]
    assert written.out == out
    assert written.frames_with_shape == FRAMES
    assert not list(folder.glob("*.part*"))
    return out


def relative(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(a - b) / np.linalg.norm(b - b.mean(axis=0)))
