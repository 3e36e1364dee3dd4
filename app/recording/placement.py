"""Where the 3-D views have the shapes: the first in the middle; in the end all of them in sight."""

from array import array
from collections.abc import Iterator

import numpy as np
import rerun as rr

from app.arrays import Array
from app.recording import entities
from app.recording.stream import Loggable
from reconstruction.basis.rest_shape import rms_radius
from reconstruction.camera import Camera

FRUSTUM = 0.4  # length of the camera's pyramid; the mesh has unit size, and is farther away
IN_SIGHT = (2.4, 1.7, 2.6)  # from the middle, where the blueprint's eye looks, across, down and away
RARE = 2.0  # percent of the frames that may be elsewhere


class Placement:
    """Unit size for the first shape at the origin, where the blueprint's eye looks; smaller if others leave the view.

    Args:
        size: (width, height) of the picture, px.

    Attributes:
        begun: whether there is a shape.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._size, self._boxes = size, array("d")
        self.begun = False

    def add(self, shape: Array, camera: Camera) -> bool:
        """Another shape (3, p), in the axes of a camera; whether it is the first."""
        first, self.begun = not self.begun, True
        if first:
            self._camera, self._radius = camera, max(rms_radius(shape), 1e-9)
        self._boxes.extend((*shape.min(axis=1), *shape.max(axis=1)))
        return first

    def transforms(self) -> Iterator[tuple[str, Loggable]]:
        """What brings all shapes so far into sight."""
        if not self.begun:
            return
        boxes = np.reshape(self._boxes, (-1, 6))
        low, high = np.percentile(boxes[:, :3], RARE, axis=0), np.percentile(boxes[:, 3:], 100 - RARE, axis=0)
        center, scale = (low + high) / 2, 1 / max(self._radius, *((high - low) / 2 / IN_SIGHT))
        for entity in (entities.MESH, entities.TRUTH):
            yield entity, rr.Transform3D(translation=-scale * center, scale=scale)
        if self._camera.perspective:
            # The viewer has no scaled cameras, and needs none: moved like the mesh, the camera sees the same.
            yield entities.CAMERA, rr.Transform3D(translation=-scale * center)
            yield (
                entities.CAMERA,
                rr.Pinhole(
                    image_from_camera=self._camera.K,
                    resolution=self._size,
                    camera_xyz=rr.ViewCoordinates.RDF,
                    image_plane_distance=FRUSTUM,
                ),
            )
