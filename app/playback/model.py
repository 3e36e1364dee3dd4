"""The models of a recording, and the last one's texture."""

from dataclasses import dataclass
from functools import partial
from typing import cast

import numpy as np

from app.arrays import Array, Image, Indices
from app.playback.reading.checks import check_model
from app.playback.reading.rows import Rows
from app.recording import entities
from reconstruction.basis.mesh import Mesh
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.model import Model
from reconstruction.camera import Camera

MODEL = "modeshape.Model:"
TEXTURE = "Mesh3D:albedo_texture_"


@dataclass(frozen=True)
class RecordedModel:
    """The model of a recording with its texture; there once the rest shape is found.

    Attributes:
        model: rest shape, modes, mesh and camera.
        size: (width, height) of the picture, px.
        texture_px: (P, 2) the vertices in the first frame.
        texture_bgr: (h, w, 3) the part of the first frame that they cover.
        texture_origin: (2,) px of that part in the frame.
    """

    model: Model
    size: tuple[int, int]
    texture_px: Array
    texture_bgr: Image
    texture_origin: Indices


def read_models(rows: Rows) -> list[Model]:
    """The models of a recording, in the order of their numbers. Raises a ValueError if one cannot be."""
    models: list[Model] = []
    while rows.last(entity := f"{entities.MODEL}/{len(models)}", f"{MODEL}rest"):
        value = partial(static, rows, entity)
        rest = value("rest").reshape(3, -1)
        Upsilon = value("Upsilon").reshape(-1, rest.shape[1])
        basis = ModalBasis(rest, Upsilon, value("eigenvalues"), value("Phi").reshape(3, 3))
        faces, edges = (value(name).reshape(-1, width).astype(np.int64) for name, width in (("faces", 3), ("edges", 2)))
        model = Model(basis, Mesh(faces, edges), Camera(float(value("focal_px")[0]), value("center_px")))
        check_model(model, value("size"), value("texture_px").reshape(-1, 2))
        models.append(model)
    return models


def with_texture(rows: Rows, models: list[Model]) -> RecordedModel | None:
    """The last of the models with its texture, or None if the recording does not have both."""
    if not models or not rows.last(entities.MESH, f"{TEXTURE}buffer"):
        return None
    value = partial(static, rows, f"{entities.MODEL}/{len(models) - 1}")
    layout = cast(list[dict[str, int]], rows.static(entities.MESH, f"{TEXTURE}format"))[0]
    rgb = np.frombuffer(cast(bytes, rows.static(entities.MESH, f"{TEXTURE}buffer")), np.uint8)
    width, height = value("size").astype(int).tolist()
    return RecordedModel(
        model=models[-1],
        size=(width, height),
        texture_px=value("texture_px").reshape(-1, 2),
        texture_bgr=rgb.reshape(layout["height"], layout["width"], 3)[:, :, ::-1].copy(),
        texture_origin=value("texture_origin").astype(np.int64),
    )


def static(rows: Rows, entity: str, name: str) -> Array:
    """A component of a model."""
    return cast(Array, rows.static(entity, f"{MODEL}{name}"))
