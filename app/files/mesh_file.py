"""A rest shape from a mesh file (OBJ, PLY, GLB, STL, OFF)."""

import warnings
from pathlib import Path

import numpy as np
import trimesh

from app.arrays import Array, Flags
from app.terminal.errors import UsageError
from reconstruction import ReconstructionError
from reconstruction.basis import rest_shape
from reconstruction.basis.mesh import Mesh, locate, mesh_from_faces
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera

LEAST_COVERED = 12  # corners inside the mesh that a run needs


def load_mesh(path: Path) -> tuple[Array, Mesh]:
    """Vertices (p, 3) and connectivity of a mesh file.

    Raises:
        UsageError: missing, unreadable, or without triangles.
    """
    if not path.is_file():
        raise UsageError(f"no mesh file {path}: give --rest-shape auto, solid, sheet, rigid, plane, or an existing file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # vertices that are in no triangle have no place in a texture
            loaded = trimesh.load_mesh(path, process=False, maintain_order=True)
        vertices, faces = np.asarray(loaded.vertices, np.float64), np.asarray(loaded.faces, np.int64)
    except Exception as error:  # trimesh's readers raise whatever comes
        raise UsageError(f"cannot read the mesh {path}: {error or type(error).__name__}") from None
    if (
        vertices.shape[1:] != (3,)
        or faces.shape[1:] != (3,)
        or len(vertices) < 4
        or len(faces) < 1
        or not np.isfinite(vertices).all()
    ):
        raise UsageError(f"the mesh {path} does not fit: it needs at least 4 finite vertices and a triangle")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise UsageError(f"the mesh {path} is damaged: its triangles name vertices that it does not have")
    return vertices, mesh_from_faces(faces)


def rest_of_vertices(path: Path, points: int) -> tuple[RestShape, Mesh]:
    """The mesh's vertices as the points themselves, in order.

    Raises:
        UsageError: another number of vertices than points.
    """
    vertices, mesh = load_mesh(path)
    if len(vertices) != points:
        raise UsageError(
            f"the mesh {path} does not fit: it has {len(vertices)} vertices, the tracks {points} points; "
            "vertex i must be point i"
        )
    return rest_shape.given(vertices.T, "mesh", f"mesh {path.name}"), mesh


def rest_of_surface(path: Path, points_px: Array, camera: Camera) -> tuple[RestShape, Flags]:
    """The corners (n, 2) px lifted onto a mesh over the first frame: x, y in its pixels, z the relative depth in pixels.

    Returns:
        the rest shape of the corners inside the mesh, and which those are (n,).

    Raises:
        UsageError: fewer than 12 corners lie inside the mesh.
    """
    vertices, mesh = load_mesh(path)
    try:
        face, weights = locate(vertices[:, :2], mesh, points_px)
    except ReconstructionError as error:
        raise UsageError(f"the mesh {path} does not fit: {error}") from None
    inside = face >= 0
    if inside.sum() < LEAST_COVERED:
        low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
        raise UsageError(
            f"the mesh {path} does not fit: {int(inside.sum())} of {len(points_px)} corners lie inside it; its x and y "
            f"must be pixels of the first frame, but span {low[0]:.0f} to {high[0]:.0f} and {low[1]:.0f} to {high[1]:.0f}"
        )
    z = np.einsum("nk,nk->n", vertices[mesh.faces[face[inside]], 2], weights[inside])
    z = z - z.mean()
    xy = points_px[inside] - camera.center_px
    if camera.perspective:
        xy = xy * (1 + z / camera.focal_px)[:, None]
    return rest_shape.given(np.column_stack([xy, z]).T, "mesh", f"mesh {path.name}"), inside
