"""Where the 3-D views have the shapes: the first as large as always, all of them in sight in the end."""

import numpy as np
import pytest
import rerun as rr

from app.arrays import Array
from app.recording import entities
from app.recording.styles import IN_SIGHT, Scene
from reconstruction.camera import Camera

CAMERA = Camera(600.0, np.array([320.0, 240.0]))
SHAPE = np.array([[-40.0, 40.0, 40.0, -40.0], [-30.0, -30.0, 30.0, 30.0], [600.0, 600.0, 600.0, 600.0]])


def seen(scene: Scene, shape: Array) -> Array:
    """A shape (3, p) as the mesh is shown."""
    transform = dict(scene.transforms())[entities.MESH]
    assert isinstance(transform, rr.Transform3D)
    scale, translation = (part.as_arrow_array().to_pylist()[0] for part in (transform.scale, transform.translation))
    return np.asarray(scale)[:, None] * shape + np.asarray(translation)[:, None]


def test_the_first_has_unit_size_in_the_middle() -> None:
    scene = Scene((640, 480))
    assert not list(scene.transforms())
    assert scene.add(SHAPE, CAMERA)
    shown = seen(scene, SHAPE)
    assert np.allclose(shown.mean(axis=1), 0, atol=1e-6)
    assert np.sqrt((shown**2).sum(axis=0).mean()) == pytest.approx(1, rel=1e-6)


@pytest.mark.parametrize("way", [(300.0, 0, 0), (0, -200.0, 0), (30.0, 20.0, 500.0)])
def test_all_are_in_sight(way: tuple[float, float, float]) -> None:
    scene = Scene((640, 480))
    shapes = [SHAPE + share * np.array(way)[:, None] for share in np.linspace(0, 1, 200)]
    first = [scene.add(shape, CAMERA) for shape in shapes]
    assert first == [True] + [False] * 199
    inside = [(abs(seen(scene, shape)) <= 1.1 * np.array(IN_SIGHT)[:, None]).all() for shape in shapes[::20]]
    assert all(inside)


def test_a_frame_that_is_lost_far_away_does_not_matter() -> None:
    scene, moved = Scene((640, 480)), Scene((640, 480))
    for k in range(100):
        scene.add(SHAPE, CAMERA)
        moved.add(SHAPE + 1e5 * (k == 50), CAMERA)
    assert np.allclose(seen(scene, SHAPE), seen(moved, SHAPE))
