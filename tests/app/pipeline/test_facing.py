"""Parts of a solid that are lost where they should show."""

import numpy as np
import pytest

from app.arrays import Flags
from app.pipeline.quality.facing import missed
from reconstruction.basis.rest_shape import RestShape, RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.map import Map
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, turns

K, P = 20, 300
RNG = np.random.default_rng(0)
XY = RNG.uniform(-100, 100, (2, P))
SHAPE = np.concatenate([XY, 0.004 * (XY**2).sum(axis=0, keepdims=True)])
SHAPE -= SHAPE.mean(axis=1, keepdims=True)


def found(seen: Flags, camera: Camera = PERSPECTIVE, degrees: float = 40.0) -> Map:
    motion = RigidMotion(SHAPE, turns(K, degrees), np.ones(K), np.zeros((K, 2)))
    return Map(RestShape("rigid", motion, ""), camera, seen=seen)


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC])
def test_a_part_that_turns_away_by_itself_is_missed(camera: Camera) -> None:
    seen = RNG.random((K, P)) > 0.2
    part = XY[1] > 80
    seen[K // 3 :, part] = False
    assert missed(found(seen, camera)) == pytest.approx(part.mean(), rel=0.1)


def test_points_missing_at_random_are_not() -> None:
    assert missed(found(RNG.random((K, P)) > 0.6)) < 0.02


def test_nor_is_a_side_that_is_turned_away() -> None:
    normals = np.concatenate([-0.008 * XY, np.ones((1, P))])
    turned = (turns(K, 60.0) @ (normals / np.linalg.norm(normals, axis=0)))[:, 2]
    assert (turned < 0.2).mean() > 0.05
    assert missed(found(turned > 0.2, ORTHOGRAPHIC, 60.0)) < 0.02
