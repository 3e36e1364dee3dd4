"""Homographies alone tell how a folded sheet lies in space."""

import numpy as np
import pytest

from reconstruction import ReconstructionError
from reconstruction.evaluation import e3d
from reconstruction.mapping.isometric.adjustment import bundled, sheet
from reconstruction.mapping.isometric.flat_parts import flat_part, folded, hemisphere
from reconstruction.mapping.isometric.images.creases import creases_in
from reconstruction.mapping.isometric.images.warps import creased, smooth_warps
from reconstruction.mapping.isometric.nodes import rays_of
from tests.reconstruction.mapping.bending import CAMERA, folding_sheet


def test_a_plane_is_found_where_it_is() -> None:
    rng = np.random.default_rng(0)
    W, S = folding_sheet(rng, (-0.7,), noise_px=0.0)  # nothing is beyond that
    part = flat_part(rays_of(W[:1], CAMERA)[0], rays_of(W, CAMERA))
    shapes = part.depths(rays_of(W[:1], CAMERA)[0])[:, None] * rays_of(W, CAMERA)
    assert e3d(shapes, S).max() < 0.02


@pytest.mark.parametrize("creases", [(0.1,), (-0.2, 0.2)])
def test_a_sheet_that_folds_is_reconstructed(creases: tuple[float, ...]) -> None:
    W, S = folding_sheet(np.random.default_rng(3), creases)
    found = sheet(W, np.ones((len(W), W.shape[2]), bool), CAMERA)
    assert len(found.field.creases) == len(creases)
    assert e3d(found.shapes(), S).mean() < 0.04
    assert e3d(bundled(found, W).shapes(), S).mean() < 0.01
    assert f"sheet with {len(creases)} crease{'s' * (len(creases) - 1)} from 15 keyframes" in found.note


def test_what_is_hidden_and_grossly_wrong_is_lived_with() -> None:
    rng = np.random.default_rng(3)
    W, S = folding_sheet(rng)
    seen = rng.random((len(W), W.shape[2])) < 0.7
    gross = seen & (rng.random(seen.shape) < 0.05)
    W = np.where(gross[:, None], W + rng.uniform(-80, 80, W.shape), W)
    found = bundled(sheet(W, seen, CAMERA), np.where(seen[:, None], W, np.nan))
    assert e3d(found.shapes(), S).mean() < 0.02


def test_parts_with_too_few_points_are_told() -> None:
    W, _ = folding_sheet(np.random.default_rng(3))
    seen = np.ones((len(W), W.shape[2]), bool)
    warps = smooth_warps(W, seen)
    narrow = np.array([[1.0, 0.0, float(np.sort(warps.reference[0])[3])]])
    logs = folded(creased(warps, W, seen, narrow), CAMERA)
    assert np.isnan(logs[0]).sum() in (3, 4)
    everywhere = creased(warps, W, seen, np.array([[1.0, 0.0, float(x)] for x in np.sort(warps.reference[0])[5::6]]))
    with pytest.raises(ReconstructionError, match="no part between creases"):
        folded(everywhere, CAMERA)
    assert len(creases_in(warps, W)) >= 1


def test_directions_are_spread_evenly_and_look_away() -> None:
    directions = hemisphere(500)
    assert (directions[:, 2] > 0).all()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    cosines = directions @ directions.T - 2 * np.eye(500)
    assert np.degrees(np.arccos(cosines.max(axis=1))).std() < 1.0
