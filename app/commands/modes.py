"""`modeshape modes`: the mode shapes of a recording's or of given tracks' rest shape as a figure."""

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np

from app.figures.modes_figure import modes_figure, spectrum, title_of
from app.files.array_file import holds_arrays
from app.files.track_file import load_tracks
from app.files.writing import check_outputs, writable
from app.options.evaluate import Evaluate
from app.options.modes import Modes
from app.terminal.progress import Progress
from app.terminal.summary import Summary
from reconstruction.basis.distances import fitting
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.rest_shape import is_flat
from reconstruction.settings import Metric, MetricChoice


@dataclass(frozen=True)
class Drawn(Summary):
    """What was drawn: the eigenvalues shown, and their share of the sum of all, where those are known: of few points."""

    source: Path
    points: int
    modes: int
    metric: str
    eigenvalues: list[float]
    share: float | None
    out: Path


def modes(command: Modes, progress: Progress) -> Drawn:
    """Carry out the command.

    Returns:
        what was drawn.

    Raises:
        UsageError, TrackingError, ReconstructionError: what stands in the way, and the remedy.
    """
    check_outputs({"--out": command.out}, [command.source], overwrite=command.overwrite)
    with progress:
        name, basis, mesh, metric = (of_tracks if holds_arrays(command.source) else of_recording)(command, progress)
        eigenvalues = spectrum(basis, mesh, metric)
        png = modes_figure(basis, mesh, eigenvalues, title=title_of(name, basis, metric), columns=command.columns)
    with writable(command.out) as file:
        file.write(png)
    whole = len(eigenvalues) > len(basis.eigenvalues)
    return Drawn(
        source=command.source,
        points=basis.rest.shape[1],
        modes=len(basis.eigenvalues),
        metric=metric,
        eigenvalues=basis.eigenvalues.tolist(),
        share=float(basis.eigenvalues.sum() / eigenvalues.clip(0).sum()) if whole else None,
        out=command.out,
    )


def of_recording(command: Modes, progress: Progress) -> tuple[str, ModalBasis, Mesh, Metric]:
    """Name, modes, mesh and metric of a recording."""
    from app.playback.playback import Playback

    playback = Playback.load(command.source)
    for note in playback.notes:
        progress.log(note)
    used = (playback.summary or {}).get("metric")  # unknown of a run that was killed
    asked = cast(MetricChoice, used or playback.configuration.get("metric", "euclidean"))
    return playback.name, playback.basis, playback.mesh, fitting(asked, flat=is_flat(playback.basis.rest))


def of_tracks(command: Modes, progress: Progress) -> tuple[str, ModalBasis, Mesh, Metric]:
    """The same of tracks: their first frames are reconstructed until there is a rest shape."""
    from app.pipeline.evaluate import prepare

    tracks = load_tracks(command.source)
    asked = Evaluate(command.source, rest_shape=command.rest_shape, camera=command.camera, model=command.model)
    reconstruction = prepare(asked, tracks, progress)
    for W, visible in zip(tracks.W, tracks.visible, strict=True):
        reconstruction.update(np.where(visible, W, np.nan), visible)
        progress.advance("rest shape")
        if reconstruction.rest is not None and reconstruction.window is not None:
            break
    else:
        reconstruction.finish()
    assert reconstruction.rest is not None
    progress.log(reconstruction.rest.note)
    assert reconstruction.metric is not None
    return Path(command.source).stem, reconstruction.model.basis, reconstruction.model.mesh, reconstruction.metric
