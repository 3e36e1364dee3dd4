"""Rest shapes from elsewhere, and how far shapes are apart."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.basis.rest_shape import apart
from reconstruction.basis.rest_shape import given as given_shape
from tests.reconstruction.world import SEEDS, flat, relief, turn

POINTS = 60


@given(SEEDS, st.sampled_from([flat, relief]))
def test_given_shapes_are_centred_and_known_to_be_flat_or_not(rng: np.random.Generator, surface) -> None:  # type: ignore[no-untyped-def]
    shape = turn((20, 30, 10)) @ surface(rng, POINTS)
    found = given_shape(shape + 100.0, "mesh", "a note")
    np.testing.assert_allclose(found.motion.shape, shape, atol=1e-9)
    assert found.flat == (surface is flat)
    assert (found.kind, found.note) == ("mesh", "a note")


@given(SEEDS)
def test_shapes_are_apart_however_they_are_turned_and_sized(rng: np.random.Generator) -> None:
    shapes = np.stack([relief(rng, POINTS) for _ in range(3)])
    others = 2.0 * turn((20, 30, 10)) @ shapes + 5.0
    mirrored = others * [[1.0], [1.0], [-1.0]]
    assert apart(shapes, others, mirrored=False) < 1e-6
    assert apart(shapes, mirrored, mirrored=True) < 1e-6
    assert apart(shapes, mirrored, mirrored=False) > 0.05
