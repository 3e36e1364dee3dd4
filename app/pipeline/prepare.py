"""What a run begins with beside its points: the estimator, with the camera they are seen by."""

from dataclasses import fields
from pathlib import Path
from typing import cast

import numpy as np

from app.arrays import Array
from app.files.writing import check_outputs
from app.options.model import Model
from app.options.run import Run
from app.pipeline.stages.messages import RECOVERED
from reconstruction.camera import picture_camera
from reconstruction.mapping.mapper import LATENCY, Mapper
from reconstruction.mapping.start import Start
from reconstruction.online import Reconstruction
from reconstruction.settings import RecoveredRestShape, Settings


def check_files(config: Run) -> None:
    """Raise a UsageError if what is to be written cannot be, is something else, or is read."""
    output = config.output
    outputs = {"--out": output.out, "--tracks-out": output.tracks_out, "--shapes-out": output.shapes_out}
    inputs = (config.source, config.mask, config.texture, config.ground_truth, config.rest_shape)
    check_outputs(outputs, inputs, overwrite=output.overwrite)


def estimator(config: Run, size: tuple[int, int], points_px: Array, start: Start, frames: int | None) -> Reconstruction:
    """The estimator before it has seen a frame, whose models are made by `start`.

    Args:
        config: what the person asked for.
        size: (width, height) of the pictures, px.
        points_px: (P, 2) the points in the first frame.
        start: as for `Mapper`.
        frames: the same.

    Raises:
        UsageError: a mesh that does not fit.
    """
    model = config.model
    focal_px = model.focal if isinstance(model.focal, float) else None
    camera = picture_camera(size, focal_px if config.camera == "perspective" else np.inf)
    settings = settings_of(model, config.rest_shape, estimate_focal=focal_px is None)
    given = None
    if config.rest_shape not in RECOVERED:
        from app.files.mesh_file import rest_of_surface  # trimesh takes its time to load

        given = rest_of_surface(Path(config.rest_shape), points_px, camera)[0]
    mapper = Mapper(settings, start, latency=LATENCY, frames=frames, live=config.live, given=given)
    return Reconstruction(camera, settings, given, mapper=mapper)


def settings_of(model: Model, rest_shape: str, *, estimate_focal: bool) -> Settings:
    """The estimator's settings with what a command decides by itself; a rest shape from elsewhere overrides them."""
    recovered = cast(RecoveredRestShape, rest_shape) if rest_shape in RECOVERED else "auto"
    chosen = {one.name: getattr(model, one.name) for one in fields(Settings)}  # another process reads them without options
    return Settings(**chosen | {"rest_shape": recovered, "estimate_focal": estimate_focal})
