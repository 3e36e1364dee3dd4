"""Branches that look alike: when another one is taken, the estimate says so, and only then."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from reconstruction.basis.rest_shape import RigidMotion
from reconstruction.camera import Camera
from reconstruction.estimate import Switch
from reconstruction.window.ambiguity import first_pose, switch_between
from reconstruction.window.solver import Solution
from tests.reconstruction.world import CAMERAS, SEEDS, model_of, random_rotation, random_state, relief, seen


@pytest.mark.parametrize(
    ("switch", "words"),
    [
        (Switch(-0.6, 2.0, 0.624), "bent back at frame 61: energy 0.62 of the other branch"),
        (Switch(0.4, 12.7, 0.9), "bent otherwise and tilted by 13° at frame 61: energy 0.90 of the other branch"),
        (Switch(1.0, 17.0, 0.5), "tilted by 17° at frame 61: energy 0.50 of the other branch"),
    ],
)
def test_a_switch_says_what_changed(switch: Switch, words: str) -> None:
    assert switch.at(61) == words


def test_a_better_fit_of_the_same_branch_is_no_switch() -> None:
    state = random_state(np.random.default_rng(0), 3, 4)
    left = Solution(state, np.full(3, 2.0), 1)
    nearly = Solution(replace(state, q=-state.q, Lambda=1.1 * state.Lambda), np.ones(3), 1)
    assert switch_between(left, nearly) is None
    bent = state.Lambda * np.array([[1.0], [1.0], [-1.0]])
    switch = switch_between(left, Solution(replace(state, Lambda=bent), np.ones(3), 1))
    assert switch is not None
    assert (switch.bend, switch.share) == (pytest.approx(-1.0), pytest.approx(0.5))
    assert switch.turned_degrees < 1e-3


@given(SEEDS, CAMERAS)
@settings(max_examples=20, deadline=None)
def test_a_solid_that_was_lost_may_have_turned_to_anywhere(rng: np.random.Generator, camera: Camera) -> None:
    shape, half = relief(rng, 60), np.arange(60) < 30
    model = model_of(shape, camera, 3)
    motion = RigidMotion(shape, np.eye(3)[None], np.ones(1), np.zeros((1, 2)))
    W = seen(shape[None], random_rotation(rng)[None], camera, depth=1.3)[0][0]
    pose = first_pose(model, motion, W, half, np.zeros((3, 0)))
    np.testing.assert_allclose(model.projection(replace(pose, Lambda=np.zeros((1, 3, 3)))), W, atol=0.1)
