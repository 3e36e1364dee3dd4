"""What a run begins with: the points of the first frame, and the estimator with the camera they are seen by."""

from dataclasses import fields
from pathlib import Path
from typing import cast, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from app.arrays import Array
from app.files.mesh_file import rest_of_surface
from app.options.model import Model
from app.options.run import Run
from reconstruction.camera import Camera
from reconstruction.mapping.mapper import Mapper, Start
from reconstruction.online import Reconstruction
from reconstruction.settings import RecoveredRestShape, Settings
from tracking.features import detect_corners
from tracking.region import region_mask
from tracking.video import Frame

RECOVERED = get_args(RecoveredRestShape)  # rest shapes that come from the first frames


def prepared(config: Run, first: Frame, start: Start) -> tuple[Array, Reconstruction]:
    """Corners (P, 2) px of the first frame, and the estimator before it has seen one, whose models are made by `start`.

    Raises:
        UsageError, TrackingError: a region, mask or mesh that does not fit the picture, or too few corners.
    """
    height, width = first.image.shape[:2]
    region = region_mask((width, height), config.roi, config.mask)
    gray = cast(NDArray[np.uint8], cv2.cvtColor(first.image, cv2.COLOR_BGR2GRAY))
    points_px = detect_corners(gray, region, config.points)
    model = config.model
    focal = model.focal if isinstance(model.focal, float) else float(width)
    camera = Camera(focal if config.camera == "perspective" else np.inf, np.array([width, height]) / 2)
    settings = settings_of(model, config.rest_shape, estimate_focal=not isinstance(model.focal, float))
    if config.rest_shape in RECOVERED:
        mapper = Mapper(settings, start, live=config.live)
        return points_px, Reconstruction(camera, settings, mapper=mapper)
    given, inside = rest_of_surface(Path(config.rest_shape), points_px, camera)
    return points_px[inside], Reconstruction(camera, settings, given)


def settings_of(model: Model, rest_shape: str, *, estimate_focal: bool) -> Settings:
    """The estimator's settings with what a command decides by itself; a rest shape from elsewhere overrides them."""
    recovered = cast(RecoveredRestShape, rest_shape) if rest_shape in RECOVERED else "auto"
    chosen = {one.name: getattr(model, one.name) for one in fields(Settings)}  # another process reads them without options
    return Settings(**chosen | {"rest_shape": recovered, "estimate_focal": estimate_focal})
