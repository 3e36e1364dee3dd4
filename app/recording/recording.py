"""Writing a recording: everything a run knows, streamed to a file and, if wanted, to a viewer.

What is written where is listed in `app.recording.entities`.
"""

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
import rerun as rr

from app.arrays import Array, Image, Indices
from app.files.writing import check_free
from app.recording import entities
from app.recording.images import cropped, embedded_video, jpeg, texture
from app.recording.stream import Stream
from app.recording.styles import LEADING, coefficient_styles, placement, styles
from app.recording.uncertainty import colors
from app.recording.viewer import running_viewer, spawned_viewer
from app.recording.wireframe import edge_strips, line_strips
from app.terminal.errors import UsageError
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modes import ModalBasis
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.settings import Metric
from tracking.klt import Observation
from tracking.video import Frame

FLUSH_FRAMES = 100  # a full disk is noticed, and a killed run keeps all it wrote, to within so many frames
NOWHERE = np.empty((0, 2))


class Recording:
    """A recording being written; a context manager that completes the file whatever happens.

    Args:
        path: the .rrd file; None writes none (with neither file nor viewer, every call does nothing).
        configuration: what the run was asked to do; stored with the version.
        size: (width, height) of the picture, px.
        connect: address of a running viewer, host:port or a rerun+http URL.
        view: start a viewer.
        image: how frames are stored: each as JPEG, the video file as it is, or not at all.
        video: the source's file, for image="video".
        overwrite: replace an existing file.
        keep_online: keep the estimates from before the final pass beside those of it.

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
        view: bool = False,
        image: Literal["jpeg", "video", "none"] = "jpeg",
        video: Path | None = None,
        overwrite: bool = False,
        keep_online: bool = False,
    ) -> None:
        self.path = path
        self._estimates = (entities.ESTIMATE, entities.ONLINE) if keep_online else (entities.ESTIMATE,)
        self._models = 0
        self._size, self._image = size, image
        self._video_ns: Indices = np.empty(0, np.int64)
        self._frames = 0
        self._last_seen: Array = NOWHERE
        self._strips: list[Indices] = []
        self._camera = Camera()
        self._placed = False
        self._stages: set[str] = set()

        urls = [running_viewer(connect)] if connect else []
        if image == "video":
            asset, self._video_ns = embedded_video(video)
        if path is not None:
            check_free(path, overwrite=overwrite)
        if view:
            urls.append(spawned_viewer())
        self._stream = Stream(path, urls)
        if path is not None:
            self._stream.name(path.stem)
        self._stream.document(entities.CONFIGURATION, "Configuration", configuration)
        self._stream.static(styles())
        if image == "video":
            self._stream.log(entities.IMAGE, asset, static=True)

    def observe(self, frame: Frame, observation: Observation, *, phase: str) -> None:
        """A frame, its tracked points and the run's phase."""
        if not self._stream.open:
            return
        self._stream.at(frame.index, frame.time_s)
        if self._frames == 1:
            self._stream.log(entities.REGION, rr.LineStrips2D([]))  # elsewhere by now
        if self._image == "jpeg":
            self._stream.log(entities.IMAGE, jpeg(frame.image))
        elif self._image == "video":
            nanoseconds = int(self._video_ns[min(frame.index, len(self._video_ns) - 1)])
            self._stream.log(entities.IMAGE, rr.VideoFrameReference(nanoseconds=nanoseconds))

        points, visible = observation.points_px, observation.visible
        if len(self._last_seen) != len(points):
            self._last_seen = np.full_like(points, np.nan)
        self._last_seen[visible] = points[visible]
        self._stream.points(entities.SEEN, points[visible])
        without_shape = not self._strips or phase.lower() == "lost"
        lost = self._last_seen[~visible & np.isfinite(self._last_seen[:, 0])] if without_shape else NOWHERE
        self._stream.points(entities.LOST, lost)
        if self._strips and without_shape:  # the model's last word would stay on the picture
            self._stream.points(entities.PREDICTED, NOWHERE)
            self._stream.log(entities.WIREFRAME, rr.LineStrips2D([]))
        self._stream.values(entities.OBSERVATION, "Observation", visible=visible, phase=phase)
        if visible.size:
            self._stream.log(entities.VISIBLE, rr.Scalars(visible.mean()))
        self._frames += 1
        if self._frames % FLUSH_FRAMES == 0:
            self._stream.flush()

    def region(self, index: int, time_s: float, outline: list[Array]) -> None:
        """The borders (n, 2) px of the region that the points of a frame are from; they are shown in that frame."""
        self._stream.at(index, time_s)
        self._stream.log(entities.REGION, rr.LineStrips2D(outline))

    def rest(self, basis: ModalBasis, mesh: Mesh, camera: Camera, texture_bgr: Image, texture_px: Array) -> None:
        """A model, of the estimates that follow; `texture_px` (p, 2) are its vertices' pixels in `texture_bgr`."""
        if not self._stream.open:
            return
        self._strips = edge_strips(mesh.edges)
        crop, origin = cropped(texture_bgr, texture_px)
        self._stream.values(
            f"{entities.MODEL}/{self._models}",
            "Model",
            static=True,
            rest=basis.rest.ravel(),
            Upsilon=basis.Upsilon.ravel(),
            eigenvalues=basis.eigenvalues,
            Phi=basis.Phi.ravel(),
            faces=mesh.faces.ravel(),
            edges=mesh.edges.ravel(),
            strips=np.concatenate([np.append(strip, -1) for strip in self._strips]),
            texture_px=texture_px.ravel(),
            texture_origin=origin,
            size=np.array(self._size),
            perspective=camera.perspective,
            focal_px=camera.focal_px,
            center_px=camera.center_px,
        )
        self._stream.log(entities.MESH, texture(crop, texture_px - origin, mesh.faces), static=True)
        self._camera = camera
        self._models += 1
        self._stream.static(coefficient_styles(len(basis.eigenvalues)))

    def final_pass(self) -> None:
        """The estimates that follow are of the final pass."""
        self._estimates = (entities.ESTIMATE,)

    def estimate(self, index: int, time_s: float, estimate: ShapeEstimate) -> None:
        """One frame's shape and pose."""
        if not self._stream.open:
            return
        self._stream.at(index, time_s)
        vertices, projection = estimate.shape.T, estimate.projection_px.astype(np.float32)
        if not self._placed:
            self._stream.static(placement(vertices, self._camera, self._size))
            self._placed = True
        known = {name: getattr(estimate, name) for name in ("quaternion", "t", "s", "visible")}
        if estimate.sigma is not None:
            known["sigma"] = estimate.sigma
        for entity in self._estimates:
            self._stream.values(entity, "Estimate", Lambda=estimate.Lambda.ravel(), model=self._models - 1, **known)
        tint = colors(estimate.sigma, estimate.shape)
        mesh = rr.Mesh3D.from_fields(vertex_positions=vertices.astype(np.float32), vertex_colors=tint)
        self._stream.log(entities.MESH, mesh)
        self._stream.log(entities.WIREFRAME, line_strips(projection, self._strips))
        self._stream.points(entities.PREDICTED, projection[~estimate.visible])
        self._stream.points(entities.LOST, NOWHERE)
        residuals = estimate.residual_px[np.isfinite(estimate.residual_px)]
        if residuals.size:
            rms_and_median = [np.sqrt(np.mean(residuals**2)), np.median(residuals)]
            self._stream.log(entities.ERROR, rr.Scalars(rms_and_median))
        self._stream.log(entities.SPECTRUM, rr.BarChart.from_fields(values=estimate.Lambda.ravel()))
        self._stream.log(entities.LEADING, rr.Scalars(estimate.Lambda[:, :LEADING].ravel()))

    def timing(self, index: int, time_s: float, stage_ms: Mapping[str, float]) -> None:
        """Milliseconds that each stage took for one frame."""
        self._stream.at(index, time_s)
        for stage, milliseconds in stage_ms.items():
            entity = f"{entities.TIMING}/{stage}"
            if stage not in self._stages:
                self._stages.add(stage)
                self._stream.log(entity, rr.SeriesLines(names=stage), static=True)
            self._stream.log(entity, rr.Scalars(milliseconds))

    def event(self, index: int, time_s: float, text: str, level: Literal["INFO", "WARN"] = "INFO") -> None:
        """Something that happened, in words."""
        self._stream.at(index, time_s)
        self._stream.log(entities.EVENTS, rr.TextLog(text, level=level))

    def modes(self, basis: ModalBasis, mesh: Mesh, metric: Metric) -> None:
        """The figure of the mode shapes, which takes about a second to draw."""
        if not self._stream.open:
            return
        from app.recording.modes_figure import modes_figure, spectrum, title_of  # matplotlib takes its time to load

        name = self.path.stem if self.path else "the run"
        figure = modes_figure(basis, mesh, spectrum(basis, mesh, metric), title=title_of(name, basis, metric), jpeg=True)
        self._stream.log(entities.MODES, rr.EncodedImage(contents=figure, media_type="image/jpeg"), static=True)

    def summary(self, values: Mapping[str, object]) -> None:
        """What came out of the run."""
        self._stream.document(entities.SUMMARY, "Summary", values)

    def close(self) -> None:
        """Complete the file; one without a frame is removed, so as not to be in the way of the next run.

        Raises:
            UsageError: it could not be written.
        """
        self._stream.close()
        if self.path is not None and self._frames == 0:
            self.path.unlink(missing_ok=True)

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
        try:
            self.close()
        finally:
            if failed and not self._placed and self.path is not None:
                self.path.unlink(missing_ok=True)
