"""Starts: no edge longer than its length, nothing to say about points without edges, no run to the depth."""

import numpy as np
import pytest

from reconstruction.mapping.isometric.images.smooth_field import smooth_field
from reconstruction.mapping.isometric.images.warps import smooth_warps
from reconstruction.mapping.isometric.nodes import edges_between, neighbours, nodes_of, on_edges, rays_of
from reconstruction.mapping.isometric.starts import depths_without_start, maximum_depth
from tests.reconstruction.mapping.bending import CAMERA, stretching_sheet, waving_sheet


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


@pytest.mark.parametrize("seed", [4, 9])
def test_what_stretches_is_not_made_deep_in_all_frames_alike(seed: int) -> None:
    W, S = stretching_sheet(np.random.default_rng(seed), stretch=0.06)
    warps = smooth_warps(W, np.ones((len(W), W.shape[2]), bool))
    nodes = nodes_of(warps)
    field = smooth_field(nodes.reference, 40)
    B = warps.values_of(field)[nodes.points]
    edges = edges_between(nodes, on_edges(nodes, field), CAMERA)
    c = depths_without_start(nodes, edges, B, field.stiffness, CAMERA)
    found = np.exp(c @ B.T)[:, None] * rays_of(nodes.images, CAMERA)

    def deep(shapes: np.ndarray) -> float:
        return float(np.median(np.ptp(shapes[:, 2], axis=1) / np.ptp(shapes[:, 0], axis=1)))

    assert deep(S) < 0.1
    assert deep(found) < 0.25  # held firm in one way only, 0.5
