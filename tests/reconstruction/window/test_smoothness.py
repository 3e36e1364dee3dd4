"""The change between neighbouring frames."""

from dataclasses import replace

import numpy as np
from hypothesis import given

from reconstruction.window.energy import Energy
from reconstruction.window.smoothness import quaternion_difference, smoothness
from tests.reconstruction.world import SEEDS, random_state, unit_quaternions


@given(SEEDS)
def test_opposite_quaternions_are_the_same_pose(rng: np.random.Generator) -> None:
    state = random_state(rng, 2, 2)
    flipped = replace(state, q=state.q * [[1.0], [-1.0]])
    np.testing.assert_allclose(flipped.matrices(), state.matrices())
    energy = Energy()
    np.testing.assert_allclose(
        smoothness(energy, flipped[:1], flipped[1:]), smoothness(energy, state[:1], state[1:]), atol=1e-14
    )
    (q,) = unit_quaternions(rng, 1)
    np.testing.assert_array_equal(quaternion_difference(q[None], -q[None]), np.zeros((1, 4)))
