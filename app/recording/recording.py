"""Writing a recording: everything a run knows, streamed to a file and, if wanted, to a viewer.

What is written where is listed in `app.recording.entities`.
"""

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from types import TracebackType
from typing import Literal, Self

import numpy as np
import rerun as rr

from app.arrays import Array, Image, Indices
from app.files.on_disk import OnDisk
from app.files.writing import check_free
from app.numbered import Numbered
from app.recording import entities
from app.recording.columns import Values, ours
from app.recording.drawing import Shape, Tint, draw
from app.recording.images import cropped, embedded_video, jpeg, reduced, texture
from app.recording.modes import small_multiples
from app.recording.stream import Stream
from app.recording.styles import SEEN_RGB, Scene, coefficient_styles, model_components, points, styles, waiting_for
from app.recording.viewer import running_viewer
from app.recording.wireframe import NO_STRIPS, Strips
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.model import Model
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from tracking.observation import Observation
from tracking.video import Frame

NOWHERE = np.empty((0, 2))
WRAP = 76  # letters in a line of the events' view


class Recording:
    """A recording being written; a context manager that completes the file whatever happens.

    Args:
        path: the .rrd file; None writes none (with neither file nor viewer, every call does nothing).
        configuration: what the run was asked to do; stored with the version.
        size: (width, height) of the picture, px.
        connect: address of a running viewer, host:port or a rerun+http URL.
        image: how frames are stored: each as JPEG, the video file as it is, or not at all.
        image_width: JPEGs are no wider than this, px.
        video: the source's file, for image="video".
        overwrite: replace an existing file.
        color: what the mesh is coloured by in the view from the side: how deep or uncertain it is, or how it is deformed.
        keep_online: keep the estimates from before the final pass beside those of it.
        final_pass: whether a final pass is to come: a file alone is drawn then, and holds nothing twice; a run that is
            killed leaves its estimates.

    Raises:
        UsageError: the file exists or cannot be written, no viewer answers, the video cannot be stored.
    """

    def __init__(
        self,
        path: Path | None,
        *,
        configuration: Mapping[str, object],
        size: tuple[int, int],
        connect: str | None = None,
        image: Literal["jpeg", "video", "none"] = "jpeg",
        image_width: int | None = None,
        video: Path | None = None,
        overwrite: bool = False,
        color: Literal["depth", "strain", "curvature"] = "depth",
        keep_online: bool = False,
        final_pass: bool = False,
    ) -> None:
        self.path = path
        self._estimates = (entities.ESTIMATE, entities.ONLINE) if keep_online else (entities.ESTIMATE,)
        self._size, self._image, self._color = size, image, color
        self._video_ns: Indices = np.empty(0, np.int64)
        self._frames, self._models, self._times = 0, 0, Numbered()
        self._last_seen: Array = NOWHERE
        self._without_shape: set[int] = set()  # frames that said so
        self._model: Model | None = None
        self._textured: tuple[bytes, ...] | None = None
        self._undrawn = OnDisk[Shape](Model, Strips, Tint)  # an hour's would fill the memory
        self._scene, self._stages = Scene(size), set[str]()
        self._image_size = reduced(size, image_width)
        self._wanted = configuration.get("bootstrap_frames")

        urls = [running_viewer(connect)] if connect else []
        self._drawn_later = final_pass and not urls
        if image == "video":
            asset, self._video_ns = embedded_video(video)
        check_free(path, overwrite=overwrite)
        self._stream = Stream(path, urls)
        if path is not None:
            self._stream.name(path.stem)
        self._stream.document(entities.CONFIGURATION, "Configuration", configuration)
        self._stream.static(styles(np.divide(size, self._image_size)))
        if image == "video":
            self._stream.log(entities.IMAGE, asset)

    def observe(self, frame: Frame, observation: Observation, *, phase: str) -> None:
        """A frame, its tracked points and the run's phase."""
        if not self._stream.open:
            return
        with self._stream.frame(frame.index, frame.time_s):
            if self._frames == 1:
                self._stream.row(entities.REGION, rr.LineStrips2D.columns, strips=NO_STRIPS)  # elsewhere by now
            if self._image == "jpeg":
                self._stream.row(entities.IMAGE, rr.EncodedImage.columns, **jpeg(frame.image, self._image_size))
            elif self._image == "video":
                nanoseconds = self._video_ns[[min(frame.index, len(self._video_ns) - 1)]]
                self._stream.row(entities.IMAGE, rr.VideoFrameReference.columns_nanos, nanoseconds=nanoseconds)

            seen_px, visible = observation.points_px, observation.visible.copy()
            if len(self._last_seen) != len(seen_px):
                self._last_seen = np.full_like(seen_px, np.nan)
            self._last_seen[visible] = seen_px[visible]
            self._stream.points(entities.SEEN, seen_px[visible])
            without_shape = self._model is None or phase.lower() == "lost"
            lost = self._last_seen[~visible & np.isfinite(self._last_seen[:, 0])] if without_shape else NOWHERE
            self._stream.points(entities.LOST, lost)
            if self._model is None or len(lost):
                self._without_shape.add(frame.index)
            if self._model and without_shape:  # the model's last word would stay on the picture
                self._stream.points(entities.PREDICTED, NOWHERE)
                self._stream.row(entities.WIREFRAME, rr.LineStrips2D.columns, strips=NO_STRIPS)
            if self._model is None:
                self._stream.row(entities.STATUS, rr.Points3D.columns, **waiting_for(self._frames + 1, self._wanted))
            self._stream.row(entities.OBSERVATION, ours("Observation"), visible=visible, phase=[phase])
            if visible.size:
                self._stream.scalars(entities.VISIBLE, visible.mean())
            self._frames += 1
            self._times[frame.index] = frame.time_s

    def region(self, index: int, time_s: float, outline: list[Array]) -> None:
        """The borders (n, 2) px of the region that the points of a frame are from; they are shown in that frame."""
        with self._stream.frame(index, time_s):
            strips = rr.components.LineStrip2DBatch(outline).as_arrow_array()
            self._stream.row(entities.REGION, rr.LineStrips2D.columns, strips=strips)

    def rest(self, basis: ModalBasis, mesh: Mesh, camera: Camera, texture_bgr: Image, texture_px: Array) -> None:
        """A model, of the estimates that follow; `texture_px` (p, 2) are its vertices' pixels in `texture_bgr`."""
        if not self._stream.open:
            return
        self._model, self._strips = Model(basis, mesh, camera), Strips(mesh.edges)
        self._tint = None if self._color == "depth" else Tint(self._color, self._model)
        crop, origin = cropped(texture_bgr, texture_px)
        components = model_components(self._model, self._strips, self._size, texture_px, origin)
        self._stream.values(f"{entities.MODEL}/{self._models}", "Model", **components)
        shown = crop.tobytes(), texture_px.tobytes(), mesh.faces.tobytes()
        if shown != self._textured:
            self._stream.log(entities.MESH, texture(crop, texture_px - origin, mesh.faces))
            self._textured = shown
        self._models += 1
        self._stream.static(coefficient_styles(len(basis.eigenvalues)))

    def final_pass(self) -> None:
        """The estimates that follow are of the final pass."""
        self._estimates, self._drawn_later = (entities.ESTIMATE,), False
        self._scene.forget()

    def estimate(self, index: int, time_s: float, estimate: ShapeEstimate) -> None:
        """One frame's shape and pose."""
        if not self._stream.open:
            return
        assert self._model is not None
        with self._stream.frame(index, time_s):
            if self._scene.add(estimate.shape, self._model.camera):
                self._stream.static(self._scene.transforms())
            known: dict[str, Values] = {name: getattr(estimate, name) for name in ("quaternion", "t", "visible")}
            known |= {"s": np.array([estimate.s]), "Lambda": estimate.Lambda.ravel(), "model": np.array([self._models - 1])}
            if estimate.sigma is not None:
                known["sigma"] = estimate.sigma
            for entity in self._estimates:
                self._stream.row(entity, ours("Estimate"), **known)
            if index in self._without_shape:
                self._without_shape.remove(index)
                self._stream.points(entities.LOST, NOWHERE)
                self._stream.row(entities.STATUS, rr.Points3D.columns, positions=np.empty((0, 3)), labels=[])
            shape = Shape.of(time_s, self._model, self._strips, self._tint, estimate)
            if self._drawn_later:
                self._undrawn.add(index, shape)
            else:
                self._undrawn.forget(index)
                draw(self._stream, shape)

    def timing(self, index: int, time_s: float, stage_ms: Mapping[str, float]) -> None:
        """Milliseconds that each stage took for one frame."""
        with self._stream.frame(index, time_s):
            for stage, milliseconds in stage_ms.items():
                entity = f"{entities.TIMING}/{stage}"
                if stage not in self._stages:
                    self._stages.add(stage)
                    self._stream.log(entity, rr.SeriesLines(names=stage))
                self._stream.scalars(entity, milliseconds)

    def event(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Something that happened, in words."""
        with self._stream.frame(index, time_s):
            self._stream.row(entities.EVENTS, rr.TextLog.columns, text=[fill(text, WRAP)], level=[level])

    def modes(self, basis: ModalBasis, mesh: Mesh) -> None:
        """The first mode shapes, beside each other."""
        if self._stream.open:
            self._stream.static(small_multiples(basis, mesh))

    def truth(self, shapes: Mapping[int, Array]) -> None:
        """True points (n, 3) of some frames, where the shapes are; those of frames that are in other files are left out."""
        for index, true in ((index, true) for index, true in shapes.items() if index in self._times):
            with self._stream.frame(index, self._times[index]):
                self._stream.row(entities.TRUTH, rr.Points3D.columns, **points(true, SEEN_RGB, -1.5))

    def summary(self, values: Mapping[str, object]) -> None:
        """What came out of the run."""
        self._stream.document(entities.SUMMARY, "Summary", values)

    def close(self, *, keep: bool = True) -> None:
        """Complete the file; one without a frame, or that is not kept, is removed: it would be in the way of the next run.

        Raises:
            UsageError: it could not be written.
        """
        try:
            for index, shape in self._undrawn.taken():  # there was no final pass
                with self._stream.frame(index, shape.time_s):
                    draw(self._stream, shape)
            self._stream.static(self._scene.transforms())
        finally:
            self._stream.close(keep=keep and self._frames > 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        try:
            self.leave(failed=isinstance(error, Exception))
        except UsageError:
            if error is None:  # what ended the run matters more
                raise

    def leave(self, *, failed: bool) -> None:
        """Close; a file of a run that failed before there was a shape is removed: there is nothing to look at.

        Raises:
            UsageError: it could not be written.
        """
        self.close(keep=self._scene.begun or not failed)
