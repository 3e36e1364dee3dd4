"""Shapes from points that were tracked elsewhere."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from modeshape.estimate import Estimate
from reconstruction import online
from reconstruction.camera import picture_camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.settings import Settings


class Reconstruction:
    """The on-line estimator, fed frame by frame with the same P points.

    The first frames (10 to 60, as needed) give the rest shape; their shapes come together, then one with each frame.

    Args:
        size: (width, height) of the picture, px.
        focal_px: focal length; infinite for an orthographic camera; None: found where the views hold it,
            else the longer side.
        settings: how to reconstruct.

    Raises:
        ValueError: settings that do not go together, or no focal length.

    >>> import numpy as np, modeshape
    >>> tracks = np.load("tracks.npy")  # (F, P, 2), NaN where a point is not seen
    >>> reconstruction = modeshape.Reconstruction((640, 480), focal_px=600)
    >>> shapes = [estimate.shape for points_px in tracks for estimate in reconstruction.update(points_px)]
    >>> shapes += [estimate.shape for estimate in reconstruction.finish()]
    >>> np.shape(shapes)
    (70, 120, 3)
    """

    def __init__(self, size: tuple[int, int], *, focal_px: float | None = None, settings: Settings | None = None) -> None:
        if focal_px is not None and not focal_px > 0:
            raise ValueError(f"focal_px {focal_px} is no focal length: give pixels, more than 0")
        settings = replace(settings or Settings(), estimate_focal=focal_px is None)
        self._estimator = online.Reconstruction(picture_camera(size, focal_px), settings)
        self._waiting: list[NDArray[np.float64]] = []
        self._done = 0
        self._threads = ThreadpoolController()  # the matrices are small: more threads are slower

    @property
    def focal_px(self) -> float:
        """The focal length: given, or what the first frames say once they are over."""
        return self._estimator.camera.focal_px

    def update(self, points_px: NDArray[np.floating], visible: NDArray[np.bool_] | None = None) -> list[Estimate]:
        """Add a frame; returns the shapes that are known with it, oldest first.

        Args:
            points_px: (P, 2) the points; NaN where one is not seen.
            visible: (P,) which are seen; without it all that are not NaN.

        Raises:
            ValueError: no rest shape can be found in the frames so far.
        """
        points = np.asarray(points_px, np.float64)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"points_px has the shape {points.shape}, but (points, 2) is needed")
        seen = np.isfinite(points[:, 0] + points[:, 1])
        if visible is not None:
            seen &= visible
        points = np.where(seen[:, None], points, np.nan)
        self._waiting.append(points)
        with self._threads.limit(limits=1):
            return self._known(self._estimator.update(points.T, seen))

    def finish(self) -> list[Estimate]:
        """No more frames: the shapes of those that still wait for a rest shape, if there are any.

        Raises:
            ValueError: no rest shape can be found in them.
        """
        with self._threads.limit(limits=1):
            known = self._known(self._estimator.finish())
        if self._waiting:
            raise ValueError("no rest shape can be found: no frame shows enough points")
        return known

    def _known(self, estimates: list[ShapeEstimate]) -> list[Estimate]:
        known = []
        for estimate in estimates:
            known.append(
                Estimate(
                    index=self._done,
                    shape=estimate.shape.T,
                    faces=self._estimator.model.mesh.faces,
                    visible=estimate.visible,
                    points_px=self._waiting.pop(0),
                    projection_px=estimate.projection_px,
                    sigma=estimate.sigma,
                )
            )
            self._done += 1
        return known
