import numpy as np

from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modal_basis import principal_axes
from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.evaluation import with_outliers
from reconstruction.mapping.solid.bundle import Bundle
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.mapping.solid.spikes import off_neighbours_plane, smoothed, without_new_spikes
from tests.reconstruction.world import PERSPECTIVE, relief, seen, shape_error, spread, turn, turns


def test_a_plane_is_on_its_neighbours_plane():
    points = spread(np.random.default_rng(0), 80)
    D, distance = off_neighbours_plane(points, triangulate(points.T).edges, np.ones(80, bool))
    np.testing.assert_allclose(D @ (3 * points[0] - 2 * points[1] + 5), 0, atol=2e-3)
    assert (distance > 0).all()


def test_a_vertex_out_of_its_neighbours_plane_shows():
    points = spread(np.random.default_rng(0), 80)
    D, _ = off_neighbours_plane(points, triangulate(points.T).edges, np.ones(80, bool))
    z = np.zeros(80)
    z[40] = 1.0
    assert (D @ z)[40] == max(D @ z) > 0.9


def test_points_on_top_of_each_other():
    points = spread(np.random.default_rng(0), 80)
    points[:, 1] = points[:, 0]
    D, _ = off_neighbours_plane(points, triangulate(points.T).edges, np.ones(80, bool))
    assert np.isfinite(D.toarray()).all()


def worst_spike(shape):
    """Largest distance of a vertex (3, p) from its neighbours' plane over the shape's width."""
    shape = principal_axes(shape).T @ shape
    D, _ = off_neighbours_plane(shape[:2], triangulate(shape[:2].T).edges, np.ones(shape.shape[1], bool))
    return np.abs(D @ shape[2]).max() / np.ptp(shape[:2], axis=1).mean()


def test_points_that_do_not_move_with_the_solid_take_their_neighbours_depth():
    rng = np.random.default_rng(6)
    shape = relief(rng, 150)
    W, _ = seen(np.repeat(shape[None], 14, axis=0), turns(14), PERSPECTIVE)
    wild = np.arange(0, 150, 25)
    visible = np.ones((14, 150), bool)
    W[:, :, wild] = with_outliers(W, visible, 1.0, rng)[:, :, wild]
    solid = bundle_adjust(W, visible, PERSPECTIVE)
    assert not solid.trusted[wild].any()
    tame = np.setdiff1d(np.arange(150), wild)
    assert solid.trusted[tame].mean() > 0.95
    assert shape_error(solid.shape[:, tame], shape[:, tame]) < 0.02
    assert worst_spike(solid.shape) < 0.15


def test_what_stands_out_of_few_points_is_no_spike():
    rng = np.random.default_rng(3)
    shape = np.concatenate([spread(rng, 36), rng.normal(0, 25, (1, 36))])  # most are far from their neighbours' plane
    shape[2, 14] = 90.0
    W, _ = seen(np.repeat(shape[None], 14, axis=0), turns(14), PERSPECTIVE)
    W = W + rng.normal(0, 1.5, W.shape)
    solid = bundle_adjust(W, rng.random((14, 36)) > 0.4, PERSPECTIVE)
    assert shape_error(solid.shape, shape) < 0.1


def test_a_side_that_the_main_plane_shows_edge_on_has_no_spikes():
    rng = np.random.default_rng(1)
    front = np.concatenate([spread(rng, 64), np.full((1, 64), -40.0)])
    y, z = np.meshgrid(np.linspace(-75, 75, 8), np.linspace(-40, 40, 8))
    side = np.stack([np.full(64, 100.0), y.ravel(), z.ravel()]) + 0.3 * rng.normal(size=(3, 64))
    shape = np.concatenate([front, side], axis=1)
    R = np.stack([turn((10 * np.sin(k), 5.0 * k, 0.0)) for k in range(16)])
    motion = RigidMotion(shape, R, np.ones(16), np.zeros((16, 2)))
    kept, sound = smoothed(np.ones((16, 128), bool), Bundle(motion, 1 / 500), np.full((16, 128), 0.2))
    assert sound.all()
    np.testing.assert_allclose(kept.shape, shape, atol=0.8)


def test_what_one_view_shows_from_the_side_is_not_carried_off():
    shape = np.random.default_rng(2).normal(size=(3, 200))
    shape *= 60 / np.linalg.norm(shape, axis=0)
    R = np.stack([turn((0.0, degrees, 0.0)) for degrees in np.linspace(-85, 85, 18)])
    visible = (R @ shape)[:, 2] < -8
    assert (visible.sum(axis=0) == 1).sum() > 3
    motion, _ = smoothed(
        visible, Bundle(RigidMotion(shape, R, np.ones(18), np.zeros((18, 2))), 0.0), np.where(visible, 0.1, np.nan)
    )
    assert np.linalg.norm(motion.shape - shape, axis=0).max() < 30


def test_what_deforms_more_than_the_rest_is_no_spike():
    rng = np.random.default_rng(4)
    shape = relief(rng, 150)
    lively = np.linalg.norm(shape[:2] - shape[:2].mean(axis=1, keepdims=True), axis=0) < 0.5 * shape[:2].std()
    shapes = np.repeat(shape[None], 24, axis=0) + rng.normal(0, 0.4, (24, 3, 150))
    shapes[:, :, lively] += rng.normal(0, 1.5, (24, 3, 1))
    W, _ = seen(shapes, turns(24), PERSPECTIVE)
    solid = bundle_adjust(W, np.ones((24, 150), bool), PERSPECTIVE)
    assert solid.trusted[lively].mean() > 0.9


def test_a_point_that_leaves_its_neighbours_and_is_lost_alone_is_put_back():
    before = relief(np.random.default_rng(5), 150)
    visible = np.ones((20, 150), bool)
    visible[8:, [40, 90]] = False
    after = before + 5
    after[2, [40, 70]] += 90  # the second is seen throughout: there is something
    kept = without_new_spikes(after, before, visible)
    np.testing.assert_allclose(np.delete(kept, 40, axis=1), np.delete(after, 40, axis=1))
    np.testing.assert_allclose(kept[:, 40], before[:, 40] + 5, atol=20)
