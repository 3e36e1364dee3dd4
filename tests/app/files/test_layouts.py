"""How other people's files are laid out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csr_array

from app.files.mesh_file import load_mesh
from app.files.track_file import load_tracks, load_truth

RNG = np.random.default_rng(0)
F, P = 12, 30
ALONG = np.linspace(-300, 300, P)
STRAP = np.stack([ALONG, ALONG + RNG.uniform(-20, 20, P)])  # x is like y: it lies along a diagonal
W = np.stack([STRAP + 3 * k * np.array([[1.0], [-0.5]]) + np.sin(ALONG / 90 + k / 3) for k in range(F)]) + 320
SEEN = RNG.random((F, P)) > 0.3


def saved(folder: Path, **arrays: Any) -> Path:
    savemat(folder / "tracks.mat", arrays)
    return folder / "tracks.mat"


@pytest.mark.parametrize("frames", [3, F])
def test_the_rows_of_what_lies_along_a_diagonal(tmp_path: Path, frames: int) -> None:
    some = W[:frames]
    for matrix in (some.reshape(2 * frames, P), some.swapaxes(0, 1).reshape(2 * frames, P)):
        np.savez(tmp_path / "tracks.npz", W=matrix)
        np.testing.assert_array_equal(load_tracks(tmp_path / "tracks.npz").W, some)


def test_points_before_frames_are_told(tmp_path: Path) -> None:
    scattered = RNG.uniform(0, 400, (2, 60)) + np.cumsum(RNG.normal(0, 2, (40, 2, 1)), axis=0)
    for W, told in ((scattered, False), (scattered.transpose(2, 0, 1), True)):
        np.savez(tmp_path / "tracks.npz", W=W)
        assert ("points of frames" in load_tracks(tmp_path / "tracks.npz").note) == told


def test_points_at_the_origin_of_truth_alone_are_not_seen(tmp_path: Path) -> None:
    S = np.concatenate([W, np.full((F, 1, P), 900.0)], axis=1)
    S[:, :, :4] = 0.0
    np.savez(tmp_path / "truth.npz", S_gt=S)
    found = load_tracks(tmp_path / "truth.npz")
    assert not found.visible[:, :4].any()
    assert found.visible[:, 4:].all()


@pytest.mark.parametrize("layout", ["sparse", "cells"])
def test_visibility_of_matlab(tmp_path: Path, layout: str) -> None:
    cells = np.empty(F, object)
    cells[:] = [row[None].astype(float) for row in SEEN]
    path = saved(tmp_path, W=W, visible=csr_array(SEEN.astype(float)) if layout == "sparse" else cells)
    np.testing.assert_array_equal(load_tracks(path).visible, SEEN)


def test_what_else_is_in_a_matlab_file_does_no_harm(tmp_path: Path) -> None:
    other = np.empty(2, object)
    other[:] = [{"a": 1.0}, {"b": 2.0}]
    found = load_tracks(saved(tmp_path, W=W, p=float(P), settings=other))
    np.testing.assert_array_equal(found.W, W)


def test_truth_is_looked_up_in_the_pixels_of_the_video(tmp_path: Path) -> None:
    K = np.array([[500.0, 0, 320], [0, 550, 240], [0, 0, 1]])
    np.savez(tmp_path / "truth.npz", W=W, K=K, S_gt=RNG.normal(size=(F, 3, P)), gt_frames=np.arange(F))
    np.testing.assert_array_equal(load_truth(tmp_path / "truth.npz").W_px, W)


def test_vertices_of_a_mesh_stay_in_order(tmp_path: Path) -> None:
    """Also the first, which is in no triangle; and those with two places in a texture."""
    (tmp_path / "rest.obj").write_text(
        "v 99 0 0\nv 0 0 0\nv 10 0 0\nv 10 10 1\nv 0 10 2\nvt 0 0\nvt 1 1\nvt 0 1\nf 2/1 3/2 4/3\nf 2/2 4/3 5/1\n"
    )
    vertices, _ = load_mesh(tmp_path / "rest.obj")
    assert vertices.tolist() == [[99, 0, 0], [0, 0, 0], [10, 0, 0], [10, 10, 1], [0, 10, 2]]
