"""Branches that look alike: when another one is taken, the estimate says so, and only then."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.basis import rest_shape
from reconstruction.estimate import Switch
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from reconstruction.window.ambiguity import switch_between
from reconstruction.window.solver import Solution
from tests.reconstruction.world import PERSPECTIVE, flat, random_state, rolled, seen, shape_error, turn

POINTS = 70


def estimates(curvatures: list[float]) -> tuple[list[Switch | None], list[float]]:
    """Of a sheet that is rolled up so much, frame by frame: switches, and errors of the shapes."""
    sheet = flat(np.random.default_rng(0), POINTS)
    shapes = np.stack([rolled(sheet, curvature) for curvature in curvatures])
    W, truth = seen(shapes, np.broadcast_to(turn((25, 0, 0)), (len(shapes), 3, 3)), PERSPECTIVE)
    settings = Settings(modes=8, deformation="inextensible")
    reconstruction = Reconstruction(PERSPECTIVE, settings, rest_shape.given(truth[0], "truth", ""))
    found = [reconstruction.update(w, np.ones(POINTS, bool))[0] for w in W]
    return [one.switch for one in found], [shape_error(one.shape, true) for one, true in zip(found, truth, strict=True)]


def test_a_sheet_that_snaps_to_the_other_side_is_a_switch_of_that_frame() -> None:
    bulging, hollow = list(np.linspace(0, 0.009, 8)), [-0.009] * 5
    switches, errors = estimates(bulging + hollow)
    assert [frame for frame, switch in enumerate(switches) if switch] == [8]
    assert switches[8] is not None
    assert switches[8].bend < 0
    assert switches[8].share < 0.95
    assert switches[8].at(61).startswith("bent back")
    assert max(errors[8:]) < 0.1


def test_a_sheet_that_bends_smoothly_does_not_switch() -> None:
    switches, _ = estimates(list(0.009 * np.sin(np.linspace(0, 3, 16))))
    assert switches == [None] * 16


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
