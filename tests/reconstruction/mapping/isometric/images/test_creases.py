"""Creases are where images have kinks, and nowhere else."""

import numpy as np
import pytest

from reconstruction.mapping.isometric.images.creases import creases_in
from reconstruction.mapping.isometric.images.smooth_field import smooth_field
from reconstruction.mapping.isometric.images.warps import Warps, creased, smooth_warps
from tests.reconstruction.mapping.bending import CAMERA, folding_sheet, waving_sheet


def off_crease(warps: Warps, S: np.ndarray, line: np.ndarray, at: float) -> float:
    """How far a line is from a true crease, RMS over it, over the image's radius."""
    uv = warps.reference[:, np.abs(across(S) - at) < 0.03]
    return float(np.sqrt(((line[:2] @ uv - line[2]) ** 2).mean()) / warps.field.radius)


def across(S: np.ndarray) -> np.ndarray:
    """Places (p,) across the creases, by distances along the flat parts of the most open shape."""
    widest = S[np.ptp(S, axis=2).max(axis=1).argmax()]
    axis = np.linalg.svd(widest - widest.mean(axis=1, keepdims=True), full_matrices=False)[0][:, 0]
    x = axis @ (widest - widest.mean(axis=1, keepdims=True))
    return np.asarray(x * np.sign(np.corrcoef(x, widest[0])[0, 1]))


@pytest.mark.parametrize("seed", [1, 2])
def test_a_crease_is_found_and_takes_what_smooth_functions_leave(seed: int) -> None:
    W, S = folding_sheet(np.random.default_rng(seed), (0.0,))
    exact = CAMERA.project(S)
    seen = np.ones((len(W), W.shape[2]), bool)
    warps = smooth_warps(W, seen)
    found = creases_in(warps, W)[0]
    assert len(found) == 1
    assert off_crease(warps, S, found[0], 0.0) < 0.15
    with_it = creased(warps, W, seen, found)
    assert np.abs(with_it.images() - exact).mean() < 0.8 * np.abs(warps.images() - exact).mean()


def test_smooth_sheets_have_none() -> None:
    for seed in range(3):
        W, _ = waving_sheet(np.random.default_rng(seed), amplitude=0.3)
        assert len(creases_in(smooth_warps(W, np.ones((len(W), W.shape[2]), bool)), W)) == 0


def test_images_that_are_smooth_exactly_have_none() -> None:
    rng = np.random.default_rng(0)
    plane = rng.uniform(100, 400, (2, 150))
    W = np.stack([turn @ plane for turn in rng.normal(size=(6, 2, 2)) + 2 * np.eye(2)])
    assert len(creases_in(smooth_warps(W, np.ones((6, 150), bool)), W)) == 0


def test_slopes_across_and_along_a_crease_are_those_of_the_functions() -> None:
    rng = np.random.default_rng(0)
    creases = np.array([[0.6, 0.8, 20.0], [1.0, 0.0, -30.0]])
    field = smooth_field(rng.uniform(-100, 100, (2, 60)), 20, creases)
    places = rng.uniform(-90, 90, (2, 40))
    h = 1e-4
    for axis in range(2):
        step = h * np.eye(2)[axis][:, None]
        numeric = (field.at(places + step) - field.at(places - step)) / (2 * h)
        np.testing.assert_allclose(field.slopes_at(places)[:, :, axis], numeric, atol=1e-6)
    assert len(field.stiffness) == field.at(places).shape[1] == 3 + 4 + 17
    assert field.sides(np.array([[100.0, -100.0], [0.0, 0.0]])).tolist() == [[True, True], [False, False]]
