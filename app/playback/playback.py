"""A recording as data again: what `modeshape review`, `retexture` and `export` work from.

What is written where is listed in `app.recording.entities`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self, cast

import numpy as np

from app.arrays import Array, Flags, Image, Indices
from app.playback.documents import DOCUMENT, NAME, SCALARS, document, events, recording_name, stages
from app.playback.frames import ESTIMATE, OBSERVATION, POSITIONS, Estimates, read_estimates, read_observations
from app.playback.images import enlarged, stored_images
from app.playback.model import MODEL, TEXTURE, RecordedModel, read_models, with_texture
from app.playback.reading.file import RecordingFile
from app.recording import entities
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.model import Model
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate

# What is kept in memory: everything but pictures and what the estimates are drawn with.
WANTED = (
    (entities.MESH, TEXTURE),
    (entities.SEEN, POSITIONS),
    (entities.TIMING, SCALARS),
    NAME,
    *(("", component) for component in (MODEL, ESTIMATE, OBSERVATION, DOCUMENT, "TextLog:")),
)


@dataclass(frozen=True)
class Playback:
    """A recording; F frames, P points, r modes.

    Attributes:
        path: its file.
        name: what viewers call it.
        version: of the modeshape that wrote it.
        configuration: what the run was asked to do.
        summary: what came out of the run; None if it was cut off.
        notes: what is missing in the recording; usually none.
        frames: (F,) numbers of the frames in their source.
        times_s: (F,) their times.
        phases: (F) phase of the run at each.
        stage_ms: by stage, (F,) milliseconds, NaN where there are none.
        events: (frame, time_s, level, text) of what happened.
        W: (F, 2, P) observed px, NaN where not visible.
        visible: (F, P) whether a point was seen.
        estimates: pose and Λ of every frame.
        recorded_model: model and texture; None if the run ended before its rest shape was found.
    """

    path: Path
    name: str
    version: str
    configuration: dict[str, object]
    summary: dict[str, object] | None
    notes: tuple[str, ...]
    frames: Indices
    times_s: Array
    phases: list[str]
    stage_ms: dict[str, Array]
    events: list[tuple[int, float, str, str]]
    W: Array
    visible: Flags
    estimates: Estimates
    recorded_model: RecordedModel | None
    file: RecordingFile

    @classmethod
    def load(cls, path: Path, *, online: bool = False) -> Self:
        """Read a recording: complete, of a run that was killed, or cut off.

        Args:
            path: its file.
            online: whether the estimates are wanted that were shown on the way, before a final pass.

        Raises:
            UsageError: it is missing, not a recording, not one of ours, or without a single frame or what is wanted.
        """
        file = RecordingFile(path)
        try:
            return cls._of(file, online=online)
        except (KeyError, TypeError, ValueError, IndexError, AttributeError, ArithmeticError) as error:
            if isinstance(error, UsageError):
                raise
            raise UsageError(
                f"{path} is not a recording that this version of modeshape can read ({error!r}): run again to make one"
            ) from error

    @classmethod
    def _of(cls, file: RecordingFile, *, online: bool) -> Self:
        rows = file.rows(*WANTED)
        entity = entities.ONLINE if online else entities.ESTIMATE
        if online and not rows.last(entity, f"{ESTIMATE}s"):
            raise UsageError(f"{file.path} does not hold what was shown on the way: run again with --keep-online")
        observed = read_observations(rows)
        if observed is None:
            raise UsageError(f"{file.path} contains no frame: the run ended before its first, or its start was lost")
        models = read_models(rows)
        used = [int(cast(Array, row.value)[0]) for row in rows.last(entity, f"{ESTIMATE}model").values()]
        if min(used, default=0) < 0:
            raise ValueError("shapes of a model before the first")
        models = models[: max(used, default=len(models)) + 1]
        if models and models[-1].basis.rest.shape[1] != observed.visible.shape[1]:
            raise ValueError("shapes and tracks are of different points")
        recorded_model = with_texture(rows, models)
        numbers = observed.frames.tolist()

        def milliseconds(stage: str) -> Array:
            found = rows.last(f"{entities.TIMING}/{stage}", SCALARS)
            return np.array([cast(Array, found[frame].value)[0] if frame in found else np.nan for frame in numbers])

        configuration, version = document(rows, entities.CONFIGURATION)
        summary = document(rows, entities.SUMMARY)[0]
        notes = []
        if file.cut_off:
            notes.append(f"{file.path} is cut off: {len(numbers)} frames, up to number {numbers[-1]}, could be read")
        elif summary is None:
            notes.append(f"{file.path} is of a run that was ended before it was complete: it has no summary")
        if recorded_model is None:
            notes.append(f"{file.path} contains no shapes: the run ended before its rest shape was found")
        estimates = read_estimates(rows, entity, numbers, models if recorded_model else [])
        mm_per_px = summary.get("mm_per_px") if summary else None
        if recorded_model and isinstance(mm_per_px, float):
            recorded_model = replace(recorded_model, model=recorded_model.model.scaled(mm_per_px))
            estimates = estimates.scaled(mm_per_px)
        return cls(
            path=file.path,
            name=recording_name(rows) or file.path.stem,
            version=version,
            configuration=configuration or {},
            summary=summary,
            notes=tuple(notes),
            frames=observed.frames,
            times_s=observed.times_s,
            phases=observed.phases,
            stage_ms={stage: milliseconds(stage) for stage in stages(rows)},
            events=events(rows),
            W=observed.W,
            visible=observed.visible,
            estimates=estimates,
            recorded_model=recorded_model,
            file=file,
        )

    @property
    def unit(self) -> str:
        """Of shapes: millimetres where a length was known, else pixels of the first frame."""
        return "millimetres" if self.summary and self.summary.get("mm_per_px") else "pixels of the first frame"

    @property
    def model(self) -> Model:
        """Rest shape, modes, mesh and camera; like the following, a UsageError if the run had found none."""
        return self._known_model.model

    @property
    def basis(self) -> ModalBasis:
        """Rest shape and modes."""
        return self.model.basis

    @property
    def mesh(self) -> Mesh:
        """Connectivity of the points."""
        return self.model.mesh

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.model.camera

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the picture, px."""
        return self._known_model.size

    @property
    def texture_px(self) -> Array:
        """The vertices (P, 2) px in the first frame."""
        return self._known_model.texture_px

    @property
    def texture_bgr(self) -> Image:
        """The part (h, w, 3) of the first frame that the vertices cover."""
        return self._known_model.texture_bgr

    @property
    def texture_origin(self) -> Indices:
        """Where (2,) px that part is in the first frame."""
        return self._known_model.texture_origin

    @cached_property
    def shaped(self) -> Flags:
        """Which frames (F,) have a shape."""
        return np.asarray(np.isfinite(self.estimates.s))

    def estimate(self, i: int) -> ShapeEstimate | None:
        """Shape and pose of the frame in row i; None if it has none.

        Raises:
            UsageError: the run ended before there was a model.
        """
        model = self.model
        return self.estimates.of(i, model, self.W[i], self.visible[i]) if self.shaped[i] else None

    def shapes(self) -> Array:
        """All shapes (F, 3, P) in camera axes, pixels of the first frame, or mm; NaN in frames without one.

        Raises:
            UsageError: the run ended before there was a model.
        """
        shapes = np.full((len(self.frames), 3, self.basis.rest.shape[1]), np.nan)
        for i in np.flatnonzero(self.shaped):
            estimate = self.estimate(int(i))
            assert estimate is not None
            shapes[i] = estimate.shape
        return shapes

    def images(self) -> Iterator[tuple[int, Image | None]]:
        """Row and picture (H, W, 3) BGR of every frame, decoded one at a time; None where there is none.

        Raises:
            UsageError: they are not all of one size.
        """
        size = self.recorded_model.size if self.recorded_model else None
        stored: tuple[int, ...] = ()
        for i, image in stored_images(self.file, self.frames.tolist()):
            if image is not None:
                stored = stored or image.shape[1::-1]
                if image.shape[1::-1] != stored:
                    raise UsageError(f"{self.path} holds pictures of several sizes: run again to make another")
            yield i, enlarged(image, size)

    @property
    def _known_model(self) -> RecordedModel:
        if self.recorded_model is None:
            raise UsageError(
                f"{self.path} contains no model: the run ended before its rest shape was found; "
                "run again for longer, or with --rest-shape plane"
            )
        return self.recorded_model
