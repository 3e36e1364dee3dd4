"""Mesh sequences, opened again by trimesh."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.app.exported import FRAMES, exported, relative
from tests.synthetic_run import Run


@pytest.mark.parametrize("kind", ["obj", "ply"])
@pytest.mark.parametrize("axes", ["camera", "y-up"])
def test_mesh_sequences_open_in_trimesh(tmp_path: Path, run: Run, kind: str, axes: str) -> None:
    folder = exported(run.path, kind, tmp_path, axes=axes)
    files = sorted(folder.glob("frame_*"))
    assert [file.name for file in files] == [f"frame_{k:06d}.{kind}" for k in range(FRAMES)]
    for file, estimate in zip(files, run.estimates, strict=True):
        mesh = trimesh.load_mesh(file, process=False, maintain_order=True)
        vertices = np.asarray(mesh.vertices) * ([1, -1, -1] if axes == "y-up" else 1)
        assert relative(vertices, estimate.shape.T) < 1e-5
        assert np.array_equal(mesh.faces, run.mesh.faces)
    image = np.asarray(mesh.visual.material.image.convert("RGB"))
    left, right = mesh.visual.uv[:, 0].argmin(), mesh.visual.uv[:, 0].argmax()
    assert run.pixels[left, 0] < run.pixels[right, 0]
    for vertex in (0, len(run.pixels) - 1):  # one in the top row, one in the bottom row of the picture
        u, v = mesh.visual.uv[vertex]
        x, y = int(u * image.shape[1]), int((1 - v) * image.shape[0])
        px, py = np.rint(run.pixels[vertex]).astype(int)
        assert np.abs(image[y, x, ::-1].astype(int) - run.picture[py, px]).max() <= 2
    assert "unit: pixels" in files[0].read_bytes()[:300].decode(errors="ignore")
