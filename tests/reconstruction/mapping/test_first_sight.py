"""A first model of what is never flat: in time, and only where it is plain."""

import numpy as np
import pytest

from reconstruction.arrays import Array
from reconstruction.camera import Camera
from reconstruction.evaluation import e3d
from reconstruction.mapping.first_sight import first_sight
from reconstruction.mapping.map import Map
from reconstruction.mapping.mapper import LATENCY, Mapper
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from tests.reconstruction.mapping.bending import CAMERA, lifted_page, stretching_sheet, waving_sheet
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, relief, seen, turns


def first(W: Array, camera: Camera = CAMERA, settings: Settings | None = None) -> Map | None:
    return first_sight(W, np.ones((len(W), W.shape[2]), np.bool_), camera, settings or Settings(estimate_focal=True))


@pytest.mark.parametrize("seed", range(3))
def test_it_is_shaped_as_in_its_first_keyframe(seed: int) -> None:
    W, S = waving_sheet(np.random.default_rng(seed), frames=7)
    found = first(W)
    assert found is not None
    assert found.rest.kind == "isometric"
    assert e3d(found.rest.motion.shape[None], S[:1])[0] < 0.02
    assert "assumed" in found.focal_note


def test_a_page_bends_to_its_own_side() -> None:
    W, S = lifted_page(np.random.default_rng(3))
    found = first(W[[4, 0, 7, 8, 9, 12, 14]])
    assert found is not None
    assert e3d(found.rest.motion.shape[None], S[4:5])[0] < 0.03


def test_what_does_not_keep_its_lengths_is_none() -> None:
    assert first(stretching_sheet(np.random.default_rng(1), 0.3, frames=7)[0]) is None


@pytest.mark.parametrize(("degrees", "swell"), [(30.0, 0.04), (5.0, 0.0)], ids=["deforms", "hardly turns"])
def test_a_solid(degrees: float, swell: float) -> None:
    rng = np.random.default_rng(2)
    shape, R = relief(rng, 120), turns(7, degrees)
    swollen = shape * (1 + swell * rng.normal(size=(7, 1, 1)) * np.sin(shape[:1] / 20))
    W = seen(swollen, R, PERSPECTIVE)[0] + 0.1 * rng.normal(size=(7, 2, 120))
    found = first(W, PERSPECTIVE)
    assert found is not None
    assert found.rest.kind == "rigid"
    assert e3d(found.rest.motion.shape[None], shape[None])[0] < 0.1


def test_a_solid_with_a_lid_is_one_but_for_the_lid() -> None:
    rng = np.random.default_rng(2)
    shapes = np.repeat(relief(rng, 120)[None], 7, axis=0)
    shapes[1::2, 2, :24] += 60.0
    W = seen(shapes, turns(7, 30.0), PERSPECTIVE)[0] + 0.1 * rng.normal(size=(7, 2, 120))
    found = first(W, PERSPECTIVE)
    assert found is not None
    assert found.rest.kind == "rigid"
    assert e3d(found.rest.motion.shape[None, :, 24:], shapes[:1, :, 24:])[0] < 0.02


def test_what_is_told() -> None:
    W, _ = waving_sheet(np.random.default_rng(0), frames=7)
    assert first(W, settings=Settings(rest_shape="solid")) is None


def test_what_is_far_away_tells_no_depth() -> None:
    W, S = waving_sheet(np.random.default_rng(0), frames=7)
    far = Camera(200 * CAMERA.focal_px, CAMERA.center_px)
    assert first(far.project(S + np.array([[0.0], [0.0], [3 * 199.0]])), far) is None
    assert first(W, ORTHOGRAPHIC) is None


def test_all_frames_have_its_shapes_until_there_is_a_map() -> None:
    W, S = waving_sheet(np.random.default_rng(0), frames=90)
    every = np.ones(W.shape[2], np.bool_)
    reconstruction = Reconstruction(CAMERA, Settings(), mapper=Mapper(Settings(), latency=LATENCY))
    shapes = [one.shape for w in W for one in reconstruction.update(w, every)]
    shapes += [one.shape for one in reconstruction.finish()]
    assert reconstruction.rest is not None
    assert reconstruction.rest.kind == "isometric"
    assert e3d(np.stack(shapes), S).mean() < 0.03
