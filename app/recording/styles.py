"""What a recording says once: models, colours, names and sizes of what is drawn, and where the scene stands."""

from array import array
from collections.abc import Iterator

import numpy as np
import rerun as rr

from app.arrays import Array, Indices
from app.recording import entities
from app.recording.columns import Values
from app.recording.stream import Loggable
from app.recording.wireframe import Strips
from reconstruction.basis.model import Model
from reconstruction.basis.rest_shape import rms_radius
from reconstruction.camera import Camera
from reconstruction.settings import FIRST_LOOKS

SEEN_RGB = (64, 224, 128)
PREDICTED_RGB = (255, 176, 0)
LOST_RGB = (255, 48, 96)
WIREFRAME_RGBA = (120, 200, 255, 80)
SPECTRUM_RGB = (150, 160, 255)
LAMBDA_RGB = (
    ((40, 120, 255), (100, 160, 255), (160, 200, 255)),
    ((0, 160, 110), (60, 200, 150), (140, 230, 190)),
    ((255, 130, 0), (255, 170, 80), (255, 210, 150)),
)
"""Leading modes of Γ_α, Γ_β, Γ_τ: a row of Λ has a hue, higher modes are paler."""

LEADING = len(LAMBDA_RGB[0])
"""Entries per row of Λ that are plotted over time."""

FRUSTUM = 0.4  # length of the camera's pyramid; the mesh has unit size, and is farther away
IN_SIGHT = (2.4, 1.7, 2.6)  # from the middle, where the blueprint's eye looks, across, down and away
RARE = 2.0  # percent of the frames that may be elsewhere

HELP = """\
# What you see

**Mesh**: the surface in three dimensions, with the colours of the first frame, seen a little from the side of the camera.
Drag to turn it, scroll to come nearer. Below it the same from the side: blue is near, red is far; with `--uncertainty`,
white is sure, red is not; with `--color strain` or `curvature`, what is longer than at rest, or bulges to you, is red.
Green points are the truth, where there is one.

**Video**: each frame with the mesh on it. Green points were seen in the frame, orange ones are hidden and drawn where the
model says they are, red ones are lost.

**Quality**: how far seen points are from where the model puts them, in pixels: below 1 is good, above 3 is poor.

**Deformation**: how much each mode is bent (τ) or stretched (α, β). **Modes**: the ways of bending, the coarsest first.

**Summary**: what came out. **Events**: what happened on the way.

The space bar plays and pauses; the arrow keys go frame by frame.
"""


def styles(shrunk: Array) -> Iterator[tuple[str, Loggable]]:
    """How points, lines and curves look, and where pictures lie that have been made smaller by factors (2,)."""
    yield entities.HELP, rr.TextDocument(HELP, media_type=rr.MediaType.MARKDOWN)
    for entity in ("/", entities.WORLD):
        yield entity, rr.ViewCoordinates.RDF
    colors = {entities.SEEN: SEEN_RGB, entities.PREDICTED: PREDICTED_RGB, entities.LOST: LOST_RGB}
    names = [(k, entity.rsplit("/", 1)[1], color) for k, (entity, color) in enumerate(colors.items(), start=1)]
    yield "/", rr.AnnotationContext(names)
    for k, entity in enumerate(colors, start=1):
        # A negative radius is in points of the screen: the same size at every zoom.
        yield entity, rr.Points2D.from_fields(class_ids=k, radii=-2.0, draw_order=30 + k, show_labels=False)
    yield entities.WIREFRAME, rr.LineStrips2D.from_fields(colors=[WIREFRAME_RGBA], radii=-0.5, draw_order=20)
    yield entities.REGION, rr.LineStrips2D.from_fields(colors=[PREDICTED_RGB], radii=-1.0, draw_order=25)
    # The viewer's pixels are squares between whole numbers; ours, like OpenCV's, have their centres there.
    yield entities.IMAGE, rr.Transform3D(translation=(-0.5, -0.5, 0.0), scale=(*shrunk, 1.0))
    yield entities.ERROR, rr.SeriesLines(names=["RMS", "median"], colors=[LOST_RGB, PREDICTED_RGB])
    yield entities.VISIBLE, rr.SeriesLines(names="seen", colors=SEEN_RGB)


def coefficient_styles(modes: int) -> Iterator[tuple[str, Loggable]]:
    """How the plots of Λ look, when the number of modes is known."""
    shown = min(LEADING, modes)
    names = [f"{row}{k + 1}" for row in ("lengthwise α", "across β", "bending τ") for k in range(shown)]
    yield entities.LEADING, rr.SeriesLines(names=names, colors=[color for row in LAMBDA_RGB for color in row[:shown]])
    # Bars in three groups. Rerun refuses a BarChart without values, and static ones would hide every frame's.
    places = np.arange(3 * modes) + np.repeat(np.arange(3) * max(1, modes // 5), modes)
    abscissa = rr.components.TensorDataBatch(places).described(rr.BarChart.descriptor_abscissa())
    color = rr.components.ColorBatch(SPECTRUM_RGB).described(rr.BarChart.descriptor_color())
    yield entities.SPECTRUM, [abscissa, color]


class Scene:
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
        if not self._boxes:
            self._camera, self._radius = camera, max(rms_radius(shape), 1e-9)
        self._boxes.extend((*shape.min(axis=1), *shape.max(axis=1)))
        return first

    def forget(self) -> None:
        """What follows is shown instead of all shapes so far."""
        self._boxes = array("d")

    def transforms(self) -> Iterator[tuple[str, Loggable]]:
        """What brings all shapes so far into sight."""
        if not self._boxes:
            return
        boxes = np.reshape(self._boxes, (-1, 6))
        low, high = np.nanpercentile(boxes[:, :3], RARE, axis=0), np.nanpercentile(boxes[:, 3:], 100 - RARE, axis=0)
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


def model_components(
    model: Model, strips: Strips, size: tuple[int, int], texture_px: Array, texture_origin: Indices
) -> dict[str, object]:
    """A model as programs read it, in the order of `entities`."""
    basis, camera = model.basis, model.camera
    return {
        "rest": basis.rest.ravel(),
        "Upsilon": basis.Upsilon.ravel(),
        "eigenvalues": basis.eigenvalues,
        "Phi": basis.Phi.ravel(),
        "faces": model.mesh.faces.astype(np.int32).ravel(),
        "edges": model.mesh.edges.astype(np.int32).ravel(),
        "strips": np.concatenate([np.append(strip, -1) for strip in strips.strips]).astype(np.int32),
        "texture_px": texture_px.ravel(),
        "texture_origin": texture_origin,
        "size": np.array(size),
        "perspective": camera.perspective,
        "focal_px": camera.focal_px,
        "center_px": camera.center_px,
    }


def waiting_for(frames: int, most: object) -> dict[str, Values]:
    """What is said in place of a mesh while the first frames are watched, `most` of them or "auto": a row of Points3D."""
    wanted = most if isinstance(most, int) else FIRST_LOOKS[-1]
    text = [f"watching the first frames: {min(frames, wanted)}/{wanted}"]
    return points(np.zeros((1, 3)), (205, 210, 220), 0.0) | {"labels": text, "show_labels": np.array([True])}


def points(positions: Array, rgb: tuple[int, int, int], radius: float) -> dict[str, Values]:
    """A row of Points3D; said once, their style would be an error where there are none."""
    red, green, blue = rgb
    color = np.array([red << 24 | green << 16 | blue << 8 | 255], np.uint32)
    return {"positions": positions.astype(np.float32), "colors": color, "radii": np.array([radius], np.float32)}
