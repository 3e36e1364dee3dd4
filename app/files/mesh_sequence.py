"""A moving mesh as one file a frame, OBJ or PLY, in a folder with the texture that all of them share."""

from pathlib import Path
from typing import Literal

import numpy as np

from app.arrays import Array, Indices

TEXTURE = "texture.png"
MATERIALS = "surface.mtl"
MATERIAL = "surface"


class MeshSequence:
    """Writes frames of one mesh.

    Only the vertices differ between the files: they are kept in order, one for each tracked point. Texture
    coordinates start at the bottom left in both formats, so that v is 1 at the top of the texture.

    Args:
        folder: where the files go; it exists.
        kind: obj or ply (binary, little endian).
        faces: (m, 3) triangles.
        uv: (p, 2) texture coordinates, 0 … 1 from the top left corner.
        comment: a line on axes and units, stored in every file.
    """

    def __init__(self, folder: Path, kind: Literal["obj", "ply"], faces: Indices, uv: Array, comment: str) -> None:
        self._folder, self._kind, self._comment = folder, kind, comment
        self._uv = np.column_stack([uv[:, 0], 1 - uv[:, 1]])
        if kind == "obj":
            rows = [f"vt {u:.6f} {v:.6f}\n" for u, v in self._uv.tolist()]
            rows += [f"usemtl {MATERIAL}\n"]
            rows += [f"f {a}/{a} {b}/{b} {c}/{c}\n" for a, b, c in (faces + 1).tolist()]
            self._constant = "".join(rows)
        else:
            records = np.empty(len(faces), [("count", "u1"), ("index", "<i4", 3)])
            records["count"], records["index"] = 3, faces
            self._triangles = records

    def texture(self, png: bytes) -> None:
        """The picture on the surface, encoded as PNG, and for OBJ the material that names it."""
        (self._folder / TEXTURE).write_bytes(png)
        if self._kind == "obj":
            # Lit by nothing: the picture has the scene's light in it.
            material = f"newmtl {MATERIAL}\nKa 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd {TEXTURE}\n"
            (self._folder / MATERIALS).write_text(material)

    def add(self, frame: int, vertices: Array) -> None:
        """The vertices (p, 3) of a frame of the source, as frame_000123.obj or .ply."""
        path = self._folder / f"frame_{frame:06d}.{self._kind}"
        path.write_bytes(self._obj(vertices) if self._kind == "obj" else self._ply(vertices))

    def _obj(self, vertices: Array) -> bytes:
        head = f"# {self._comment}\nmtllib {MATERIALS}\n"
        rows = "".join([f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in vertices.tolist()])
        return (head + rows + self._constant).encode()

    def _ply(self, vertices: Array) -> bytes:
        head = [
            "ply",
            "format binary_little_endian 1.0",
            f"comment {self._comment}",
            f"comment TextureFile {TEXTURE}",
            f"element vertex {len(vertices)}",
            *(f"property float {name}" for name in ("x", "y", "z", "s", "t")),
            f"element face {len(self._triangles)}",
            "property list uchar int vertex_indices",
            "end_header\n",
        ]
        records = np.column_stack([vertices, self._uv]).astype("<f4")
        return "\n".join(head).encode() + records.tobytes() + self._triangles.tobytes()
