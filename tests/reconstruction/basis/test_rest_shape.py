"""Rest shapes from elsewhere."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

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
