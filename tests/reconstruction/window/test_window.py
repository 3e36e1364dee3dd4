"""The sliding window: frame after frame, on surfaces whose true shape is known."""

from collections.abc import Callable

import numpy as np
import pytest

from reconstruction.basis.constraints import fitting
from reconstruction.basis.model import build_model
from reconstruction.basis.rest_shape import given
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.evaluation import e3d
from reconstruction.settings import Deformation
from reconstruction.window.energy import build_energy, build_guide
from reconstruction.window.robust import FEWEST_POINTS
from reconstruction.window.window import SlidingWindow
from tests.reconstruction.world import (
    ORTHOGRAPHIC,
    PERSPECTIVE,
    bending_sheet,
    flat,
    random_rotation,
    relief,
    rolled,
    seen,
    shape_error,
    turn,
)

FRAMES, POINTS, MODES = 26, 70, 8
MIRROR = np.diag([1.0, 1.0, -1.0])


def window_of(
    rest: np.ndarray,
    camera: Camera = PERSPECTIVE,
    deformation: Deformation = "auto",
    *,
    length: int = 3,
    modes: int = MODES,
) -> SlidingWindow:
    """A window about a rest shape (3, p) in camera axes, as the estimator builds it; nothing refines the rest shape."""
    shape = given(rest, "truth", "")
    model, kind = build_model(shape, camera, modes, "chi-squared"), fitting(deformation, flat=shape.flat)
    return SlidingWindow(model, build_energy(model, kind), length, shape.motion, guide=build_guide(model, kind))


def advanced(window: SlidingWindow, W: np.ndarray, visible: np.ndarray | None = None) -> list[ShapeEstimate]:
    visible = np.ones((len(W), W.shape[2]), bool) if visible is None else visible
    return [window.advance(np.where(h, w, np.nan), h) for w, h in zip(W, visible, strict=True)]


def shapes_of(estimates: list[ShapeEstimate]) -> np.ndarray:
    return np.stack([one.shape for one in estimates])


def error(estimates: list[ShapeEstimate], truth: np.ndarray) -> float:
    return float(e3d(shapes_of(estimates), truth).mean())


def still_error(truth: np.ndarray) -> float:
    return float(e3d(np.broadcast_to(truth[0], truth.shape), truth).mean())


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE])
def test_a_solid_may_be_seen_from_anywhere_in_the_next_frame(camera: Camera) -> None:
    rng = np.random.default_rng(0)
    shape = relief(rng, POINTS)
    R = np.stack([np.eye(3), *(turn((0.0, 4.0 * k, 0.0)) for k in range(1, 5)), *(random_rotation(rng) for _ in range(12))])
    window = window_of(shape, camera, "general")
    found = advanced(window, seen(np.broadcast_to(shape, (len(R), *shape.shape)), R, camera, depth=1.5)[0])
    assert error(found, R @ shape) < 0.02
    assert any(one.switch is not None for one in found)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("shown", range(6))
def test_a_solid_that_surprises_by_few_points_is_posed_anew_by_enough_of_them_alone(shown: int) -> None:
    rng = np.random.default_rng(1)
    shape = relief(rng, POINTS)
    R = np.stack([turn((0.0, 3.0 * k, 0.0)) for k in range(7)])
    W = seen(np.broadcast_to(shape, (7, *shape.shape)), R, PERSPECTIVE, depth=1.5)[0]
    visible = np.ones((7, POINTS), bool)
    visible[5] = np.arange(POINTS) < shown
    W[5] += 60 * rng.standard_normal(W[5].shape)
    found = advanced(window_of(shape, PERSPECTIVE, "general"), W, visible)
    assert np.isfinite(shapes_of(found)).all()
    if shown < FEWEST_POINTS:
        assert error(found[-1:], R[-1:] @ shape) < 0.03
        assert found[5].switch is None


@pytest.mark.parametrize("length", [1, 2, 3, 8])
def test_a_window_of_any_length_follows_a_bending_sheet(length: int) -> None:
    W, truth = bending_sheet()
    window = window_of(truth[0], length=length)
    found = []
    for f, w in enumerate(W):
        found.append(window.advance(w, np.ones(POINTS, bool)))
        assert window.state is not None
        assert len(window.state) == min(f + 1, length)
    assert [one.frame for one in found] == list(range(FRAMES))
    assert error(found, truth) < 0.7 * still_error(truth)


def test_what_is_rigid_stays_so() -> None:
    sheet = rolled(flat(np.random.default_rng(0), POINTS), 0.006)
    R = np.stack([turn((3 * f, 2 * f, f)) for f in range(8)])
    W, truth = seen(np.broadcast_to(sheet, (8, 3, POINTS)), R, PERSPECTIVE)
    found = advanced(window_of(truth[0], deformation="general"), W)
    assert e3d(shapes_of(found), truth).max() < 1e-3
    assert max(one.residual_px.max() for one in found) < 0.05


def permuted(W: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, Camera, Callable[[np.ndarray], np.ndarray]]:
    order = np.random.default_rng(3).permutation(W.shape[2])
    return W[:, :, order], truth[:, :, order], PERSPECTIVE, lambda S: S[:, :, order]


def enlarged(W: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, Camera, Callable[[np.ndarray], np.ndarray]]:
    return 2 * W, 2 * truth, Camera(2 * PERSPECTIVE.focal_px, 2 * PERSPECTIVE.center_px), lambda S: 2 * S


def shifted(W: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray, Camera, Callable[[np.ndarray], np.ndarray]]:
    step = np.array([70.0, -30.0])
    return W + step[:, None], truth, Camera(PERSPECTIVE.focal_px, PERSPECTIVE.center_px + step), lambda S: S


@pytest.mark.parametrize("changed", [permuted, enlarged, shifted])
def test_order_of_points_size_and_place_of_the_picture_do_not_matter(changed) -> None:  # type: ignore[no-untyped-def]
    W, truth = bending_sheet()
    W_other, truth_other, camera, expected = changed(W, truth)
    one, other = advanced(window_of(truth[0]), W), advanced(window_of(truth_other[0], camera), W_other)
    np.testing.assert_allclose(shapes_of(other), expected(shapes_of(one)), atol=0.05)


def test_an_orthographic_camera_sees_a_shape_and_its_mirror_image_alike() -> None:
    W, truth = bending_sheet(ORTHOGRAPHIC)
    one = advanced(window_of(truth[0], ORTHOGRAPHIC, "bending"), W)
    other = advanced(window_of(MIRROR @ truth[0], ORTHOGRAPHIC, "bending"), W)
    np.testing.assert_allclose(shapes_of(other), MIRROR @ shapes_of(one), atol=0.05)


def test_the_next_frame_is_predicted_at_constant_velocity() -> None:
    W, truth = bending_sheet()
    window = window_of(truth[0])
    assert window.predict() is None
    for f, w in enumerate(W):
        predicted = window.predict()
        if f > 2:
            assert predicted is not None
            assert predicted.shape == (POINTS, 2)
            surprise = np.sqrt(((predicted.T - w) ** 2).sum(axis=0).mean())
            step = np.sqrt(((W[f - 1] - w) ** 2).sum(axis=0).mean())
            assert surprise < max(1.5, step)
        window.advance(w, np.ones(POINTS, bool))


def test_a_surface_found_again_elsewhere_goes_on_with_its_last_shape() -> None:
    W, truth = bending_sheet()
    window = window_of(truth[0])
    before = advanced(window, W[:14])
    window.restart()
    assert window.state is None
    assert window.predict() is None
    W_again, truth_again = seen(truth[13][None] - truth[13].mean(axis=1)[:, None], turn((0, 0, 120))[None], PERSPECTIVE)
    again = advanced(window, W_again)
    assert [one.frame for one in before + again] == list(range(15))
    assert error(again, truth_again) < 1.5 * error(before[-1:], truth[13:14])


@pytest.mark.parametrize("size_px", [25, 80])
def test_outliers_cost_hardly_more_than_hiding_them(size_px: float) -> None:
    W, truth = bending_sheet()
    W, truth = W[:14], truth[:14]
    rng = np.random.default_rng(0)
    wrong = rng.random((14, POINTS)) < 0.05
    wrong[0] = False
    hidden = advanced(window_of(truth[0]), W, ~wrong)
    there = advanced(window_of(truth[0]), W + np.where(wrong[:, None], rng.normal(0, size_px, W.shape), 0.0))
    assert error(there, truth) < error(hidden, truth) + 0.005


@pytest.mark.slow
@pytest.mark.parametrize("size_px", [25, 80])
def test_outliers_among_many_points_and_modes(size_px: float) -> None:
    W, truth = bending_sheet(points=300)
    rng = np.random.default_rng(0)
    wrong = rng.random((FRAMES, 300)) < 0.05
    wrong[0] = False
    hidden = advanced(window_of(truth[0], modes=20), W, ~wrong)
    there = advanced(window_of(truth[0], modes=20), W + np.where(wrong[:, None], rng.normal(0, size_px, W.shape), 0.0))
    assert error(there, truth) < error(hidden, truth) + 0.005


@pytest.mark.parametrize("seen_points", [0, 3, 10])
def test_frames_with_few_points_neither_fail_nor_fly_away(seen_points: int) -> None:
    W, truth = bending_sheet()
    visible = np.ones((FRAMES, POINTS), bool)
    visible[10:13] = False
    visible[10:13, : seen_points * 7 : 7] = True
    per_frame = e3d(shapes_of(advanced(window_of(truth[0]), W, visible)), truth)
    still = e3d(np.broadcast_to(truth[0], truth.shape), truth)
    assert np.isfinite(per_frame).all()
    assert (per_frame[10:13] < 1.1 * still[10:13]).all()  # at worst pulled back to rest
    assert per_frame[-1] < 0.06  # and finds back


def snapping(curvatures: list[float]) -> tuple[list[ShapeEstimate], np.ndarray]:
    """A sheet that is rolled up so much, frame by frame, and its true shapes."""
    sheet = flat(np.random.default_rng(0), POINTS)
    shapes = np.stack([rolled(sheet, curvature) for curvature in curvatures])
    W, truth = seen(shapes, np.broadcast_to(turn((25, 0, 0)), (len(shapes), 3, 3)), PERSPECTIVE)
    return advanced(window_of(truth[0]), W), truth


def test_a_sheet_that_snaps_to_the_other_side_is_a_switch_of_that_frame() -> None:
    found, truth = snapping([*np.linspace(0, 0.009, 8), *[-0.009] * 5])
    assert [one.frame for one in found if one.switch] == [8]
    assert found[8].switch is not None
    assert found[8].switch.bend < 0
    assert found[8].switch.share < 0.95
    assert max(shape_error(one.shape, true) for one, true in zip(found[8:], truth[8:], strict=True)) < 0.1


def test_a_sheet_that_bends_smoothly_does_not_switch() -> None:
    found, _ = snapping(list(0.009 * np.sin(np.linspace(0, 3, 16))))
    assert all(one.switch is None for one in found)
