"""What is learned by some of the points, and what follows for all."""

import numpy as np
import pytest

from reconstruction.camera import Camera
from reconstruction.evaluation import e3d
from reconstruction.mapping.solid.deforming.attempt import Attempt, among_all, begun
from reconstruction.mapping.solid.placing import well_spread
from tests.reconstruction.mapping.solid.deforming.test_learning import keyframes, mapped, shown, turned
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE


@pytest.mark.parametrize("camera", [PERSPECTIVE, pytest.param(ORTHOGRAPHIC, marks=pytest.mark.slow)])
def test_what_some_points_have_told_holds_for_all(camera: Camera) -> None:
    shapes, W, visible = keyframes(0.06, camera, points=600)
    every = shown(mapped(W, visible, camera), W, visible)
    some = well_spread(every.rigid.rest.motion.shape, visible, 150)
    few = every.of_points(some)
    model, first = begun(few.rigid, few)
    told = Attempt(model, few.learned(model, first, first.log_s), first.log_s)
    whole = among_all(told, some, every)
    of_some, of_all = (
        float(e3d(turned(one.known.B, one.known.state), shapes[:, :, points]).mean())
        for one, points in ((told, some), (whole, np.arange(600)))
    )
    assert of_all < 1.1 * of_some
    assert whole.about(every.rigid).rest.motion.shape.shape == (3, 600)
