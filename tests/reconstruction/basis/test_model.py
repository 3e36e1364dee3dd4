"""The bridge between pixels and the dimensionless solver."""

import numpy as np
import pytest
from hypothesis import given

from reconstruction.basis.model import Model, triangulated
from reconstruction.basis.rest_shape import RestShape, RigidMotion
from reconstruction.camera import Camera, rotation_from_quaternion
from reconstruction.state import State
from reconstruction.window import statistics
from reconstruction.window.statistics import image_statistics
from tests.reconstruction.world import CAMERAS, PERSPECTIVE, SEEDS, flat, model_of, random_state, relief, spread, turns

POINTS, MODES = 40, 5


def near_state(rng: np.random.Generator) -> State:
    """Two frames before the camera: nothing comes nearer than the focal point."""
    state = random_state(rng, 2, MODES)
    return State(state.q, state.t, state.log_s, 0.1 * state.Lambda)


@given(SEEDS, CAMERAS)
def test_estimated_shape_is_seen_where_the_projection_says(rng: np.random.Generator, camera: Camera) -> None:
    model, state = model_of(relief(rng, POINTS), camera, MODES), near_state(rng)
    W = 100 * rng.normal(size=(2, POINTS))
    visible = rng.random(POINTS) < 0.6
    estimate = model.estimate(7, np.where(visible, W, np.nan), visible, state, row=0)
    assert estimate.frame == 7
    np.testing.assert_allclose(camera.project(estimate.shape).T, estimate.projection_px, atol=1e-8)
    np.testing.assert_allclose(model.projection(state, 0).T, estimate.projection_px, atol=1e-8)
    np.testing.assert_array_equal(np.isfinite(estimate.residual_px), visible)
    expected = np.linalg.norm(W - estimate.projection_px.T, axis=0)
    np.testing.assert_allclose(estimate.residual_px[visible], expected[visible])


@given(SEEDS, CAMERAS)
def test_estimate_is_the_deformed_rest_shape_placed_by_its_pose(rng: np.random.Generator, camera: Camera) -> None:
    model, state = model_of(relief(rng, POINTS), camera, MODES), near_state(rng)
    estimate = model.estimate(0, np.zeros((2, POINTS)), np.ones(POINTS, bool), state, row=1)
    np.testing.assert_allclose(rotation_from_quaternion(estimate.quaternion), estimate.R, atol=1e-10)
    assert np.linalg.det(estimate.R) == pytest.approx(1.0)
    turned = estimate.R @ model.basis.deform(estimate.Lambda)
    centred = estimate.shape - estimate.shape.mean(axis=1, keepdims=True)
    scale = 1.0 if camera.perspective else estimate.s
    np.testing.assert_allclose(centred, scale * (turned - turned.mean(axis=1, keepdims=True)), atol=1e-8)
    if camera.perspective:  # the origin's depth is f/s, and it is seen at t
        origin = (estimate.shape - turned).mean(axis=1)
        assert origin[2] == pytest.approx(camera.focal_px / estimate.s)
        np.testing.assert_allclose(camera.project(origin[:, None])[:, 0] - camera.center_px, estimate.t, atol=1e-8)


@given(SEEDS, CAMERAS)
def test_everything_inside_is_dimensionless(rng: np.random.Generator, camera: Camera) -> None:
    shape = relief(rng, POINTS)
    one = model_of(shape, camera, MODES)
    two = model_of(2 * shape, Camera(2 * camera.focal_px, 2 * camera.center_px), MODES)
    np.testing.assert_allclose((one.B[:3] ** 2).sum() / POINTS, 1.0)
    np.testing.assert_allclose((one.B[3:-1] ** 2).sum(axis=1) / POINTS, 1.0)
    np.testing.assert_allclose(two.B, one.B, atol=1e-7)
    W, weights, state = 100 * rng.normal(size=(2, POINTS)), rng.random(POINTS), near_state(rng)[:1]
    values = [
        statistics.value(image_statistics(model, k * W, weights), state.matrices())[0] for model, k in ((one, 1), (two, 2))
    ]
    assert values[1] == pytest.approx(values[0], rel=1e-6)


@given(SEEDS, CAMERAS)
def test_data_term_is_the_mean_squared_reprojection_error_weighted_by_depth(
    rng: np.random.Generator, camera: Camera
) -> None:
    model, state = model_of(relief(rng, POINTS), camera, MODES), near_state(rng)[:1]
    W = model.projection(state) + rng.normal(size=(2, POINTS))
    value = statistics.value(image_statistics(model, W, np.ones(POINTS)), state.matrices())[0]
    depth = 1 + (state.matrices()[0] @ model.B)[2] / model.focal
    direct = ((model.residuals(W, state) * depth / model.radius) ** 2).sum() / POINTS
    assert value == pytest.approx(direct, rel=1e-6)


@given(SEEDS, CAMERAS)
def test_rigid_statistics_are_those_without_modes(rng: np.random.Generator, camera: Camera) -> None:
    model, state = model_of(relief(rng, POINTS), camera, MODES), near_state(rng)[:1]
    still = State(state.q, state.t, state.log_s, np.zeros((1, 3, MODES)))
    rigid = State(state.q, state.t, state.log_s, np.zeros((1, 3, 0)))
    W, weights = 100 * rng.normal(size=(2, POINTS)), rng.random(POINTS)
    np.testing.assert_allclose(
        statistics.value(image_statistics(model, W, weights, rigid=True), rigid.matrices()),
        statistics.value(image_statistics(model, W, weights), still.matrices()),
        rtol=1e-9,
    )


@pytest.mark.parametrize("surface", [relief, flat])
@pytest.mark.parametrize("vertices", [10, 30, 1000])
def test_coarse_edges_span_the_shape(surface, vertices: int) -> None:  # type: ignore[no-untyped-def]
    model: Model = model_of(surface(np.random.default_rng(4), POINTS), PERSPECTIVE, MODES)
    edges = model.coarse_edges(vertices)
    np.testing.assert_allclose(np.linalg.norm(edges.rest, axis=0), edges.length)
    assert edges.length.min() > 0
    used = min(vertices, POINTS)
    assert used - 1 <= len(edges.length) <= 3 * used - 6
    assert edges.modes.shape == (MODES, len(edges.length))


@given(SEEDS)
def test_a_shape_has_a_state_only_before_the_camera(rng: np.random.Generator) -> None:
    model, state = model_of(relief(rng, POINTS), PERSPECTIVE, MODES), near_state(rng)
    seen = np.ones(POINTS, np.bool_)
    shape = model.estimate(0, np.zeros((2, POINTS)), seen, state).shape
    found = model.state_of(shape, PERSPECTIVE, seen, None)
    assert found is not None
    assert np.isfinite(found.log_s).all()
    assert model.state_of(-shape, PERSPECTIVE, seen, None) is None


@given(SEEDS, CAMERAS)
def test_some_of_the_points_have_the_poses_and_coefficients_of_all(rng: np.random.Generator, camera: Camera) -> None:
    model, state = model_of(relief(rng, POINTS), camera, MODES), near_state(rng)
    some = np.sort(rng.choice(POINTS, POINTS // 2, replace=False))
    few, visible = model.of_points(some), np.ones(POINTS, bool)
    whole = model.estimate(0, np.zeros((2, POINTS)), visible, state, row=0)
    part = few.estimate(0, np.zeros((2, len(some))), visible[some], state, row=0)
    np.testing.assert_allclose(part.shape, whole.shape[:, some], atol=1e-8)
    np.testing.assert_allclose(few.projection(state, 0), model.projection(state, 0)[:, some], atol=1e-8)


@pytest.mark.parametrize("camera", [Camera(), PERSPECTIVE])
def test_triangles_of_a_solid_do_not_overlap_in_the_view_that_shows_most(camera: Camera) -> None:
    rng = np.random.default_rng(0)
    shape = np.concatenate([spread(rng, 60), rng.normal(0, 100, (1, 60))])
    motion = RigidMotion(turns(3)[1].T @ shape, turns(3), np.ones(3), np.zeros((3, 2)))
    seen = np.ones((3, 60), np.bool_)
    seen[[0, 2], ::4] = False
    faces = triangulated(RestShape("rigid", motion, ""), camera, seen).faces
    placed = motion.R[1] @ motion.shape
    x, y = placed[:2] / (1 + placed[2] / camera.focal_px)
    a, b, c = faces.T
    area = (x[b] - x[a]) * (y[c] - y[a]) - (x[c] - x[a]) * (y[b] - y[a])
    assert (np.sign(area) == np.sign(area[0])).all()
    assert len(np.unique(faces)) == 60
