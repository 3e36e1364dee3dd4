"""A Gaussian of shapes by those of keyframes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.camera import nearest_rotation
from reconstruction.mapping.isometric.shape_prior import ShapePrior, shape_prior

SEEDS = st.integers(0, 10_000).map(np.random.default_rng)
F, R, M = 6, 8, 50


def some(rng: np.random.Generator, *, of_others: bool = False) -> tuple[np.ndarray, ShapePrior]:
    """Shapes near one another, turned, and the prior of them."""
    B = np.concatenate([np.ones((M, 1)), rng.standard_normal((M, R - 1))], axis=1)
    shapes = rng.standard_normal((3, R)) + 0.1 * rng.standard_normal((F, 3, R))
    C = nearest_rotation(rng.standard_normal((F, 3, 3))) @ shapes
    C[:, :, 0] += rng.standard_normal((F, 3))
    return C, shape_prior(C, B, np.r_[0.0, 0.0, 0.0, np.linspace(1, 9, R - 3)], of_others=of_others)


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_a_shape_costs_the_same_however_it_is_turned_and_wherever_it_is(rng: np.random.Generator) -> None:
    C, prior = some(rng)
    turned = nearest_rotation(rng.standard_normal((F, 3, 3))) @ C
    turned[:, :, 0] += 0.1
    np.testing.assert_allclose(prior.cost(turned), prior.cost(C), rtol=1e-3, atol=1e-4)


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_cost_is_what_precision_and_way_say(rng: np.random.Generator) -> None:
    C, prior = some(rng)
    held, away = prior.at(C)
    np.testing.assert_allclose(np.einsum("fi,fij,fj->f", away, held, away), prior.cost(C), rtol=1e-6)


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_axes_are_cheap_and_what_no_keyframe_shows_is_dear(rng: np.random.Generator) -> None:
    C, prior = some(rng)
    assert (prior.cost(C) < 2 * F).all()  # Mahalanobis distances of F samples
    assert prior.cost(C[:1] + 0.1 * rng.standard_normal((1, 3, R)))[0] > 10 * F


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_each_keyframe_judged_by_the_others_is_as_if_it_had_given_no_axis(rng: np.random.Generator) -> None:
    C, by_others = some(rng, of_others=True)
    held, _ = by_others.at(C)
    for f in (0, F - 1):
        without = ShapePrior(
            by_others.mean, by_others.gram, np.delete(by_others.axes, f, axis=0), by_others.held, of_others=False
        )
        np.testing.assert_allclose(held[f], without.at(C[f : f + 1])[0][0], rtol=1e-4, atol=1e-4 * np.abs(held[f]).max())


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_it_does_not_depend_on_units(scale: float) -> None:
    C, prior = some(np.random.default_rng(0))
    B = np.concatenate([np.ones((M, 1)), np.random.default_rng(0).standard_normal((M, R - 1))], axis=1)
    scaled = shape_prior(scale * C, B, np.r_[0.0, 0.0, 0.0, np.linspace(1, 9, R - 3)], of_others=False)
    np.testing.assert_allclose(scaled.cost(scale * C), prior.cost(C), rtol=1e-6)
