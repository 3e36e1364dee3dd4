"""The binary part of a glTF file."""

import pygltflib as gltf

from app.arrays import Array, Indices

LARGEST_SHORT_INDEX = 65534  # 65535 is reserved


class Buffer:
    """The binary part of a file, filled accessor by accessor."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.views: list[gltf.BufferView] = []
        self.accessors: list[gltf.Accessor] = []

    def view(self, content: bytes, target: int | None = None) -> int:
        """Append bytes; returns the index of their view."""
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        self.views.append(gltf.BufferView(buffer=0, byteOffset=len(self.bytes), byteLength=len(content), target=target))
        self.bytes += content
        return len(self.views) - 1

    def floats(self, values: Array, target: int | None = None, *, bounds: bool = False) -> int:
        """Append values (n,) or (n, 2 … 4) as float32; returns the index of their accessor."""
        single = values.astype("<f4")
        columns = 1 if single.ndim == 1 else single.shape[1]
        accessor = gltf.Accessor(
            bufferView=self.view(single.tobytes(), target),
            componentType=gltf.FLOAT,
            count=len(single),
            type=[gltf.SCALAR, gltf.VEC2, gltf.VEC3, gltf.VEC4][columns - 1],
        )
        if bounds:
            rows = single.reshape(-1, columns)
            accessor.min, accessor.max = rows.min(axis=0).tolist(), rows.max(axis=0).tolist()
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def indices(self, faces: Indices) -> int:
        """Append triangles (m, 3); returns the index of their accessor."""
        short = faces.max() <= LARGEST_SHORT_INDEX
        flat = faces.ravel().astype("<u2" if short else "<u4")
        accessor = gltf.Accessor(
            bufferView=self.view(flat.tobytes(), gltf.ELEMENT_ARRAY_BUFFER),
            componentType=gltf.UNSIGNED_SHORT if short else gltf.UNSIGNED_INT,
            count=flat.size,
            type=gltf.SCALAR,
        )
        self.accessors.append(accessor)
        return len(self.accessors) - 1
