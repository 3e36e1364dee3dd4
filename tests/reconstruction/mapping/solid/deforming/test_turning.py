"""Stretches of a video whose poses are mirrored in depth, told by how the thing turns before and after."""

import numpy as np
import pytest

from reconstruction.arrays import Array, Indices
from reconstruction.camera import Camera, quaternion_exp
from reconstruction.evaluation import e3d
from reconstruction.mapping.solid.deforming.attempt import Attempt
from reconstruction.mapping.solid.deforming.reversal import in_reverse
from reconstruction.mapping.solid.deforming.rounds import Rounds
from reconstruction.mapping.solid.deforming.turning import turned_on, turning_back, unsteadiness
from reconstruction.state import State, join
from tests.reconstruction.mapping.solid.deforming.test_reversal import EVERYTHING, fish, shown, turned
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE

K = 40
FRAMES = np.cumsum(np.random.default_rng(0).integers(1, 5, K))
MIRRORED = slice(12, 25)


def turning(degrees: Array) -> State:
    """Poses of a thin shape by its angles about an upright axis."""
    upright = np.radians(degrees)[:, None] * np.array([0.0, 1.0, 0.0])
    return State(quaternion_exp(upright), np.zeros((K, 2)), np.zeros(K), np.zeros((K, 3, 1)))


@pytest.mark.parametrize("frames", [FRAMES, np.arange(K)])
def test_what_is_mirrored_for_a_while_turns_back(frames: Indices) -> None:
    state = turning(5.0 * frames)
    wrong = join([state[: MIRRORED.start], in_reverse(state[MIRRORED]), state[MIRRORED.stop :]])
    back = turning_back(wrong, frames)
    assert back.sum() == pytest.approx(MIRRORED.stop - MIRRORED.start, abs=1)
    assert back[MIRRORED.start + 1 : MIRRORED.stop - 1].all()
    assert unsteadiness(state, frames) < 0.5 * unsteadiness(wrong, frames)


@pytest.mark.parametrize(
    "angles",
    [5.0 * np.arange(K), 30 * np.sin(np.arange(K) / 10), 6 * np.abs(np.arange(K) % 8 - 4), np.zeros(K)],
    ids=["turns", "sways", "nods in jerks", "rests"],
)
def test_what_turns_steadily_sways_or_rests_stays_as_it_is(angles: Array) -> None:
    assert not turning_back(turning(angles), np.arange(K)).any()


@pytest.mark.parametrize("camera", [ORTHOGRAPHIC, PERSPECTIVE])
def test_what_turns_on_is_learned_anew(camera: Camera) -> None:
    W, placed, rigid, model, state = fish(camera, MIRRORED)
    rounds = Rounds(model, np.arange(W.shape[2]), model.normalised(W), EVERYTHING, state.log_s)
    before = Attempt(model, rounds.begun(model.B, state), state.log_s)
    after = turned_on(before, shown(rigid, W), 40, 60)
    assert after is not None
    errors = [e3d(turned(one.known.B, one.known.state), placed).mean() for one in (before, after)]
    assert errors[1] < 0.3 * errors[0]
    assert turned_on(after, shown(rigid, W), 40, 60) is None
