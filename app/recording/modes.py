"""The first mode shapes as small coloured meshes beside each other (paper's Fig. 2), which the viewer draws itself."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import rerun as rr

from app.arrays import Array, Image, Indices
from app.recording import entities
from app.recording.stream import Loggable
from reconstruction.basis.mesh import Mesh, vertex_normals
from reconstruction.basis.modal_basis import ModalBasis

AMPLITUDE = 0.18  # largest displacement, as a share of the rest shape's length
TURN_DEGREES, TILT_DEGREES = 32.0, 28.0  # of the view against the first frame's camera: neither frontal nor from the side
LIGHT = np.array([-0.45, -0.65, -0.62])  # from the upper left, behind the eye
MOVEMENT_RGB = np.array([(47, 111, 183), (134, 182, 224), (233, 231, 226), (242, 169, 120), (200, 80, 45)])
"""Of a mode's values from the most negative to the most positive."""

SHOWN, COLUMNS = 8, 4
GAP = 0.12  # between neighbours, as a share of their size
OUT_OF_PLANE = 2  # the principal axis


@dataclass(frozen=True)
class View:
    """A parallel projection onto the paper: rows of `axes` (3, 3) are its right, its down and away from the eye."""

    axes: Array

    @classmethod
    def three_quarter(cls) -> "View":
        """The first frame's camera, moved to the side and up."""
        turn, tilt = np.deg2rad(TURN_DEGREES), np.deg2rad(TILT_DEGREES)
        c, s = np.cos(turn), np.sin(turn)
        about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        c, s = np.cos(tilt), np.sin(tilt)
        about_x = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
        return cls(about_x @ about_y)

    def flat(self, shape: Array) -> Array:
        """Points (p, 2) on paper, y up, of a shape (3, p)."""
        right, down, _ = self.axes @ shape
        return np.column_stack([right, -down])


def small_multiples(basis: ModalBasis, mesh: Mesh) -> Iterator[tuple[str, Loggable]]:
    """The leading modes out of the plane, row by row, where a viewer that looks along z sees them."""
    view, length = View.three_quarter(), float(np.ptp(basis.Phi[:, 0] @ basis.rest))
    modes = range(min(SHOWN, len(basis.eigenvalues)))
    shapes = [view.axes @ displaced(basis, OUT_OF_PLANE, mode, length) for mode in modes]
    middle = (view.axes @ basis.rest).mean(axis=1, keepdims=True)
    size = (1 + GAP) * np.max([np.ptp(shape, axis=1) for shape in shapes], axis=0)
    rows = -(-len(shapes) // COLUMNS)
    scale = 2.0 / max(min(len(shapes), COLUMNS) * size[0], 1.6 * rows * size[1])  # as wide as the eye of the blueprint sees
    names = np.zeros((len(shapes), 3), np.float32)
    for mode, shape in zip(modes, shapes, strict=True):
        row, column = divmod(mode, COLUMNS)
        place = np.array([column - (min(len(shapes), COLUMNS) - 1) / 2, row - (rows - 1) / 2, 0.0]) * size
        names[mode] = scale * (place - (0.0, 0.56 * size[1], 0.0))
        yield (
            f"{entities.MODES}/{mode + 1}",
            rr.Mesh3D(
                vertex_positions=scale * (shape - middle + place[:, None]).T,
                triangle_indices=mesh.faces,
                vertex_colors=colored(basis.Upsilon[mode], brightness(shape, mesh.faces, View(np.eye(3)))),
            ),
        )
    labels = [f"mode {mode + 1}" for mode in modes]
    yield f"{entities.MODES}/names", rr.Points3D(names, labels=labels, show_labels=True, radii=0.0, colors=(205, 210, 220))


def displaced(basis: ModalBasis, axis: int, mode: int, length: float) -> Array:
    """The rest shape (3, p) moved along a principal axis by a mode, as far as is well seen."""
    return np.asarray(basis.rest + AMPLITUDE * length * np.outer(basis.Phi[:, axis], normalised(basis.Upsilon[mode])))


def normalised(values: Array) -> Array:
    """From -1 to 1."""
    return values / max(float(np.abs(values).max()), 1e-12)


def colored(values: Array, light: Array) -> Image:
    """Colours (p, 3) RGB of a mode's values (p,) in a light (p,)."""
    place = np.linspace(-1, 1, len(MOVEMENT_RGB))
    rgb = [np.interp(normalised(values), place, channel) for channel in MOVEMENT_RGB.T]
    return np.rint(np.stack(rgb, axis=1) * light[:, None]).astype(np.uint8)


def brightness(shape: Array, faces: Indices, view: View) -> Array:
    """Light (p,) from 0 to 1 on the vertices of a shape (3, p), the same on both sides of the surface."""
    light = view.axes.T @ (LIGHT / np.linalg.norm(LIGHT))
    return np.asarray(0.42 + 0.58 * np.abs(vertex_normals(shape.T, faces) @ light))
