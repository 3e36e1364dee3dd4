"""The convex start: no edge longer than its length, and nothing to say about points without edges."""

import numpy as np

from reconstruction.mapping.isometric.nodes import neighbours, rays_of
from reconstruction.mapping.isometric.starts import maximum_depth
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet


def test_deepest_shapes_are_near_the_true_ones() -> None:
    W, S = waving_sheet(np.random.default_rng(1), frames=10, points=40, noise_px=0.0)
    ends = neighbours(W, 6)
    depth = maximum_depth(rays_of(W, CAMERA), ends, np.ones((10, len(ends)), bool))
    ratio = np.log(depth / S[:, 2])
    assert np.std(ratio) < 0.15


def test_points_without_edges_are_unknown() -> None:
    W, _ = waving_sheet(np.random.default_rng(2), frames=5, points=30, noise_px=0.0)
    ends = neighbours(W, 6)
    seen = np.ones((5, len(ends)), bool)
    seen[2, (ends == 7).any(axis=1)] = False
    depth = maximum_depth(rays_of(W, CAMERA), ends, seen)
    assert np.isnan(depth[2, 7])
    assert np.isfinite(np.delete(depth[2], 7)).all()


def test_with_lengths_known_the_deepest_shapes_keep_them() -> None:
    W, S = waving_sheet(np.random.default_rng(1), frames=10, points=60, noise_px=0.0)
    ends = neighbours(W, 6)
    i, j = ends.T
    lengths = np.linalg.norm(S[:, :, i] - S[:, :, j], axis=1).mean(axis=0)
    depth = maximum_depth(rays_of(W, CAMERA), ends, np.ones((10, len(ends)), bool), lengths)
    found = depth[:, None] * rays_of(W, CAMERA)
    assert (np.linalg.norm(found[:, :, i] - found[:, :, j], axis=1) < 1.01 * lengths).all()
    assert np.std(np.log(depth / S[:, 2])) < 0.05
