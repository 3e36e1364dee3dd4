"""States of a window: steps, and frames joined and taken apart."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.state import POSE, join
from tests.reconstruction.world import SEEDS, random_state

ROWS = st.sampled_from([(0, 1, 2), (2,), (0, 1), ()])


@given(SEEDS, ROWS)
def test_steps_move_only_the_free_rows(rng: np.random.Generator, rows: tuple[int, ...]) -> None:
    state = random_state(rng, 2, 3)
    step = rng.normal(size=(2, POSE + 3 * len(rows)))
    moved = state.moved(step, rows)
    fixed = [row for row in range(3) if row not in rows]
    np.testing.assert_array_equal(moved.Lambda[:, fixed], state.Lambda[:, fixed])
    np.testing.assert_allclose((moved.Lambda - state.Lambda)[:, rows].reshape(2, -1), step[:, POSE:])
    np.testing.assert_allclose(np.linalg.norm(moved.q, axis=1), 1.0)
    np.testing.assert_allclose(state.moved(np.zeros_like(step), rows).matrices(), state.matrices())


def test_joined_states_can_be_taken_apart() -> None:
    state = random_state(np.random.default_rng(2), 4, 2)
    again = join([state[:1], state[1:]])
    assert len(again) == 4
    np.testing.assert_array_equal(again.matrices(), state.matrices())
