"""How much of the deformations goes with the turn of the whole."""

import numpy as np
import pytest

from reconstruction.camera import quaternion_from_rotation
from reconstruction.mapping.solid.deforming.deformations import going_with_turn
from reconstruction.state import State
from tests.reconstruction.world import turns

K, R = 60, 8


def keyframes(course: np.ndarray) -> State:
    """Keyframes of a thing that goes round, with deformations that go by `course` (K,), and a little of everything."""
    rng = np.random.default_rng(2)
    Lambda = course[:, None, None] * rng.normal(size=(3, R)) + 0.1 * rng.normal(size=(K, 3, R))
    return State(quaternion_from_rotation(turns(K)), np.zeros((K, 2)), np.zeros(K), Lambda)


def test_what_swells_as_it_turns_goes_with_the_turn() -> None:
    assert going_with_turn(keyframes(turns(K)[:, 0, 2] / turns(K)[:, 0, 2].std())) > 0.9


@pytest.mark.parametrize("seed", range(5))
def test_what_moves_at_any_time_does_not(seed: int) -> None:
    assert going_with_turn(keyframes(np.random.default_rng(seed).normal(size=K))) < 0.3


def test_half_and_half() -> None:
    rng = np.random.default_rng(1)
    course = turns(K)[:, 0, 2] / turns(K)[:, 0, 2].std() + rng.normal(size=K)
    assert 0.3 < going_with_turn(keyframes(course)) < 0.7


def test_what_does_not_turn_tells_nothing() -> None:
    state = keyframes(np.random.default_rng(1).normal(size=K))
    still = State(np.repeat(state.q[:1], K, axis=0), state.t, state.log_s, state.Lambda)
    assert going_with_turn(still) == 0.0
