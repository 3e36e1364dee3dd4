"""The tilt of a flat sheet from the frames after the first."""

import numpy as np
import pytest

from reconstruction.camera import tilt_axes
from reconstruction.mapping.sheet import best_tilted, sheet
from tests.reconstruction.world import PERSPECTIVE, flat, seen, turn, turns

FRAMES, POINTS = 16, 60


def views(tilt: tuple[float, float, float], degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Images (F, 2, p) px of a tilted sheet that sways by some degrees, and its normal in the first frame."""
    rng = np.random.default_rng(4)
    R = turns(FRAMES, degrees) @ turn(tilt)
    W, _ = seen(np.broadcast_to(flat(rng, POINTS), (FRAMES, 3, POINTS)), R, PERSPECTIVE)
    return W + rng.normal(0, 0.1, W.shape), R[0][:, 2]


@pytest.mark.parametrize(
    "tilt", [(0.0, 50.0, 0.0), (-50.0, 0.0, 0.0), (40.0, -35.0, 0.0), (10.0, 0.0, 0.0), (0.0, -25.0, 0.0)]
)
@pytest.mark.parametrize(("degrees", "sharp"), [(6.0, 1.15), (20.0, 2.0)])
def test_any_tilt_is_found_the_more_sharply_the_more_it_turns(
    tilt: tuple[float, float, float], degrees: float, sharp: float
) -> None:
    W, normal = views(tilt, degrees)
    visible = np.random.default_rng(0).random((FRAMES, POINTS)) < 0.9
    found, sharpness = best_tilted(W[0], np.where(visible[:, None], W, np.nan), visible, PERSPECTIVE)
    off = np.rad2deg(np.arccos(min(1.0, abs(normal @ found.R[0][:, 2]))))
    assert off < 4
    assert sharpness > sharp
    assert len(found.R) == FRAMES
    np.testing.assert_array_equal(found.shape[2], 0.0)


def test_a_sheet_that_keeps_still_does_not_tell_its_tilt() -> None:
    W, _ = views((0.0, 30.0, 0.0), 0.0)
    _, sharpness = best_tilted(W[0], W, np.ones((FRAMES, POINTS), bool), PERSPECTIVE)
    assert sharpness < 1.05


def test_axes_are_unit_and_evenly_spread() -> None:
    axes = tilt_axes(8)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0)
    np.testing.assert_allclose((axes * np.roll(axes, 1, axis=0)).sum(axis=1), np.sqrt(0.5))
    np.testing.assert_array_equal(axes[:, 2], 0.0)


def test_the_sheet_looks_like_the_image_at_every_tilt() -> None:
    W, _ = views((0.0, 0.0, 0.0), 0.0)
    for axis in tilt_axes():
        motion = sheet(W[0], turn(tuple(40 * axis)), PERSPECTIVE)
        placed = motion.R[0] @ motion.shape
        image = (placed[:2] + motion.t[0][:, None]) / (1 + placed[2] / PERSPECTIVE.focal_px) + PERSPECTIVE.center_px[
            :, None
        ]
        difference = image - W[0]
        assert np.abs(difference - difference.mean(axis=1, keepdims=True)).max() < 3.0
