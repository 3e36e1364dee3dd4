import numpy as np
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from reconstruction.mapping.solid.views import building_order, completed, first_views, likeness, with_unseen
from tests.reconstruction.world import SEEDS, spread


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_similarities_come_back_despite_outliers_and_missing_points(rng):
    x = spread(rng, 60)
    a = np.exp(1j * rng.uniform(-np.pi, np.pi, 5)) * rng.uniform(0.5, 2, 5)
    b = rng.normal(size=5) + 1j * rng.normal(size=5)
    z = a[:, None] * (x[0] + 1j * x[1]) + b[:, None]
    W, visible = np.stack([z.real, z.imag], axis=1), rng.random((5, 60)) > 0.2
    wrong = rng.random((5, 60)) < 0.08
    W = np.where(wrong[:, None], rng.uniform(-100, 100, W.shape), W)
    alike = likeness(W, visible)
    np.testing.assert_allclose(alike.a, a[None] / a[:, None], rtol=0.02)
    first = completed(W, visible, alike, 0)
    clean = np.array([z[0].real, z[0].imag])
    assert np.median(np.abs(first - clean)) < 0.05 * np.abs(clean).max()


def test_a_path_of_views_is_followed_from_its_middle():
    x = spread(np.random.default_rng(0), 50)
    W = np.stack([x * np.array([[1 - 0.1 * k], [1.0]]) for k in range(7)])
    alike = likeness(W, np.ones((7, 50), bool))
    (middle,) = first_views(alike, np.ones((7, 50), bool))
    order, parent = building_order(alike, middle)
    assert sorted(order) == list(range(7))
    assert order[0] in (2, 3, 4)
    assert (np.abs(order - parent)[1:] == 1).all()


def test_views_that_share_nothing_are_built_on_last() -> None:
    rng = np.random.default_rng(3)
    W = rng.normal(0, 50, (4, 2, 40))
    W[1:3] = W[0] + rng.normal(0, 1, (2, 2, 40))
    visible = np.ones((4, 40), bool)
    visible[3, :38] = False
    visible[:3, 38:] = False
    alike = likeness(W, visible)
    order, _ = building_order(alike, first_views(alike, visible)[0])
    assert order[-1] == 3
    assert sorted(order.tolist()) == [0, 1, 2, 3]
    assert np.isfinite(alike.a).all()
    assert np.isfinite(completed(W, visible, alike, int(order[0]))).all()


def test_nothing_is_built_on_a_view_of_a_few_points() -> None:
    """Three points fit any similarity."""
    shape, seen_in_all = np.random.default_rng(4).normal(0, 50, (3, 60)), np.ones((15, 60), bool)
    W = Rotation.from_rotvec(np.linspace(-0.4, 0.4, 15)[:, None] * [0, 1, 0]).as_matrix()[:, :2] @ shape
    (middle,) = first_views(likeness(W, seen_in_all), seen_in_all)
    assert 5 < middle < 9
    few = seen_in_all.copy()
    few[14, 3:] = False
    assert first_views(likeness(W, few), few) == [middle]


def test_points_that_no_view_shows_are_where_they_were_known_to_be() -> None:
    rng = np.random.default_rng(4)
    known = rng.normal(size=(3, 30))
    R = Rotation.from_rotvec([0.4, -0.9, 0.3]).as_matrix()
    true = 5.0 * R @ known + np.array([[3.0], [1.0], [-2.0]])
    seen = np.arange(30) > 3
    shape = np.where(seen, true, 1e3)
    np.testing.assert_allclose(with_unseen(shape, seen, known), true, atol=1e-9)
    alone = with_unseen(shape, seen, None)
    np.testing.assert_allclose(alone[:, seen], true[:, seen])
    np.testing.assert_allclose(alone[:, ~seen].T, np.tile(true[:, seen].mean(axis=1), (4, 1)))


def test_front_and_back_are_not_alike_for_few_points_they_share() -> None:
    rng = np.random.default_rng(5)
    W, visible = rng.normal(0, 50, (3, 2, 80)), np.ones((3, 80), bool)
    W[1] = W[0] + rng.normal(0, 1, (2, 80))
    W[2, :, 36:44] = W[0, :, 36:44]  # by chance
    visible[:2, 44:] = False
    visible[2, :36] = False
    apart = likeness(W, visible).distance
    assert apart[0, 2] > 1e3 * apart[0, 1]
    assert likeness(W[:, :, 36:], visible[:, 36:]).distance[0, 2] < 1e-6  # all that either shows


def test_what_hides_its_far_side_is_begun_on_all_sides_but_not_where_little_shows() -> None:
    rng = np.random.default_rng(5)
    W, around = rng.normal(0, 50, (12, 2, 60)), np.arange(60) // 5
    visible = (around - np.arange(12)[:, None]) % 12 < 6  # half of the points, of other sides in each
    visible[3] &= around == 3
    views = first_views(likeness(W, visible), visible)
    assert len(views) == len(set(views)) > 4
    assert 3 not in views
    assert {view // 4 for view in views} == {0, 1, 2}
