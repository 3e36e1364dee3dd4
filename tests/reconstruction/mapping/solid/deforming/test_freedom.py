"""How many modes a solid is worth: few if it is rigid, more if it deforms here and there."""

import numpy as np
import pytest

from reconstruction.mapping.solid.deforming.freedom import modes_held
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.settings import MORE_MODES, MOST_MODES, USUAL_MODES
from tests.reconstruction.world import PERSPECTIVE, relief, seen, turns

K, P = 30, 120


@pytest.mark.parametrize(
    ("points", "deforms", "modes"), [(P, False, USUAL_MODES), (P, True, MOST_MODES), (40, True, MORE_MODES)]
)
def test_as_many_modes_as_the_keyframes_show(points: int, deforms: bool, modes: int) -> None:
    rng = np.random.default_rng(2)
    shapes = np.repeat(relief(rng, points)[None], K, axis=0)
    if deforms:  # small bumps anywhere, each for itself
        width = np.ptp(shapes[0, 0])
        for centre in shapes[0, :2, rng.choice(points, 12)]:
            bump = np.exp(-((shapes[0, :2] - centre[:, None]) ** 2).sum(axis=0) / (0.12 * width) ** 2)
            shapes = shapes + 0.03 * width * rng.normal(size=(K, 3, 1)) * bump
    W, _ = seen(shapes, turns(K), PERSPECTIVE)
    W = W + 0.2 * rng.normal(size=W.shape)
    visible = rng.random((K, points)) > 0.1
    solid = bundle_adjust(W, visible, PERSPECTIVE, refine_focal=False)
    assert modes_held(np.where(visible[:, None], W, np.nan), visible, solid) == modes


def test_few_keyframes_have_few_modes() -> None:
    rng = np.random.default_rng(4)
    shapes = relief(rng, P) + 4.0 * rng.normal(size=(K - 1, 3, P))
    W, _ = seen(shapes, turns(K - 1), PERSPECTIVE)
    visible = np.ones((K - 1, P), bool)
    solid = bundle_adjust(W, visible, PERSPECTIVE, refine_focal=False)
    assert modes_held(W, visible, solid) == USUAL_MODES


def test_few_points_have_few_modes() -> None:
    rng = np.random.default_rng(3)
    W, _ = seen(np.repeat(relief(rng, 20)[None], K, axis=0), turns(K), PERSPECTIVE)
    solid = bundle_adjust(W, np.ones((K, 20), bool), PERSPECTIVE, refine_focal=False)
    assert modes_held(W, np.ones((K, 20), bool), solid) == USUAL_MODES
