"""What few modes cannot follow is not judged by them."""

from functools import partial

import numpy as np

from reconstruction.arrays import Array, Mask
from reconstruction.basis.rest_shape import RestShape
from reconstruction.evaluation import e3d
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.deforming.attempt import Attempt, Shown, begun
from reconstruction.mapping.solid.deforming.learning import RIGHTED
from reconstruction.mapping.solid.deforming.starts import explains_anything, further, likeliest, shallower, tried
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.settings import MOST_MODES, Settings
from tests.reconstruction.world import ORTHOGRAPHIC, seen, spread, turns

K, P = 24, 150


def shirt(seed: int) -> tuple[Array, Array, Mask]:
    """Shapes (K, 3, P) of a shirt on a chest, small folds travelling over it, and images with noise and gaps."""
    rng = np.random.default_rng(seed)
    (x, y), time = spread(rng, P), np.linspace(0, 1, K)[:, None]
    folds = np.sin(2 * np.pi * (2.5 * x + 3 * y) / 200 + 12 * time + rng.uniform(0, 6))
    radius = 100 + 4 * folds * (1 + np.sin(9 * time + rng.uniform(0, 6)))
    shapes = np.stack([radius * np.sin(x / 100), np.broadcast_to(y, radius.shape), -radius * np.cos(x / 100)], axis=1)
    W, in_camera = seen(shapes - shapes.mean(axis=2, keepdims=True), turns(K, 25.0), ORTHOGRAPHIC)
    return in_camera, W + 0.3 * rng.normal(size=W.shape), rng.random((K, P)) > 0.1


def test_small_folds_do_not_put_poses_wrong() -> None:
    shapes, W, visible = shirt(3)
    solid = bundle_adjust(np.where(visible[:, None], W, np.nan), visible, ORTHOGRAPHIC, refine_focal=False)
    found = Map(RestShape("rigid", solid.motion, "made here"), ORTHOGRAPHIC)
    shown = Shown(found, Settings(), W, visible, visible, np.arange(K))
    model, first = begun(found, shown, MOST_MODES)
    start = Attempt(model, shown.learned(model, first, first.log_s, RIGHTED), first.log_s)
    end, _ = likeliest(start, shown)
    state, B = end.known.state, end.known.B
    assert not explains_anything(end, shown)
    assert e3d(state.scaled_rotations() @ (B[:3] + state.Lambda @ B[3:-1]), shapes).mean() < 0.03
    flatter = tried(shown, partial(shallower, solid.motion, 0.3))
    assert flatter is not None
    assert further(flatter, shown, (start, end)) == (start, end)
