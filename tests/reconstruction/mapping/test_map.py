"""What an object is by its keyframes: kind, rest shape, camera, and shapes of other frames, in any unit and camera."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from reconstruction.basis.mesh import ratio_of_sizes
from reconstruction.basis.model import build_model
from reconstruction.basis.rest_shape import completed, given, medoid
from reconstruction.camera import Camera
from reconstruction.evaluation import e3d
from reconstruction.mapping.map import Map
from reconstruction.mapping.maps import map_of
from reconstruction.mapping.solid.solid import Solid, bundle_adjust
from reconstruction.online import Reconstruction
from reconstruction.settings import Settings
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, flat, relief, seen, turns

FRAMES, POINTS = 24, 150


@cache
def waving() -> tuple[np.ndarray, np.ndarray, Map]:
    W, S = waving_sheet(np.random.default_rng(5), FRAMES)
    found = map_of(W[::2], np.ones((FRAMES // 2, POINTS), bool), CAMERA, estimate_focal=False)
    assert found is not None
    return W, S, found


def expected_error(found: Map, W: np.ndarray, truth: np.ndarray) -> float:
    """Of the shapes of all frames, as the modes of the rest shape hold them."""
    model = build_model(found.rest, found.camera, 20)
    shapes, state = [], None
    for w in W:
        state = found.expected(model, found.foreseen([(w, np.ones(POINTS, bool))])[0], state)
        assert state is not None
        shapes.append(model.estimate(0, w, np.ones(POINTS, bool), state).shape)
    return float(e3d(np.stack(shapes), truth).mean())


def test_a_sheet_that_is_never_flat() -> None:
    W, S, found = waving()
    assert found.rest.kind == "isometric"
    assert expected_error(found, W[1::2], S[1::2]) < 0.05
    R, s, t = found.rest.motion.R, found.rest.motion.s, found.rest.motion.t
    posed = s[:, None, None] * R @ found.rest.motion.shape
    image = (posed[:, :2] + t[:, :, None]) / (1 + posed[:, 2:] / CAMERA.focal_px) + CAMERA.center_px[:, None]
    assert np.median(np.abs(image - W[::2])) < 0.05 * np.ptp(W)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_units_do_not_matter(unit: float) -> None:
    W, _, found = waving()
    camera = Camera(CAMERA.focal_px * unit, CAMERA.center_px * unit)
    again = map_of(W[::2] * unit, np.ones((FRAMES // 2, POINTS), bool), camera, estimate_focal=False)
    assert again is not None
    np.testing.assert_allclose(again.rest.motion.shape, found.rest.motion.shape * unit, rtol=1e-4, atol=1e-4 * unit)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_rest_shape_that_was_given_stays_and_all_frames_are_found(unit: float) -> None:
    W, S, _ = waving()
    shape = given(unit * S[0], "truth", "given")
    reconstruction = Reconstruction(CAMERA, Settings(), shape)
    every = np.ones(POINTS, bool)
    before = [e for w in W for e in reconstruction.update(w, every)]
    assert reconstruction.revise((w, every) for w in W)
    after = [e for w in W for e in reconstruction.update(w, every)]
    assert reconstruction.rest is not None
    np.testing.assert_allclose(reconstruction.rest.motion.shape, shape.motion.shape)
    off, once = (float(e3d(np.stack([e.shape for e in made]), S).mean()) for made in (after, before))
    assert off < min(0.04, 0.5 * once)
    kept = Reconstruction(CAMERA, Settings(refine_rest=False), shape)
    assert kept.update(W[0], every)
    assert not kept.revise([(W[0], every)])


def test_what_keyframes_show_stays_with_their_poses() -> None:
    _, _, found = waving()
    K = len(found.rest.motion.s)
    found, order = replace(found, seen=np.random.default_rng(1).random((K, POINTS)) < 0.5), np.arange(K)[::-1]
    assert found.seen is not None
    again = found.in_order(order)
    assert again.seen is not None
    np.testing.assert_array_equal(again.seen, found.seen[order])
    np.testing.assert_array_equal(again.rest.motion.R, found.rest.motion.R[order])


def test_a_sheet_before_an_orthographic_camera() -> None:
    _, S, _ = waving()
    W = 300 * (S - S.mean(axis=2, keepdims=True))[:, :2] + np.array([320.0, 240.0])[:, None]
    W = W + np.random.default_rng(0).normal(0, 0.1, W.shape)
    found = map_of(W, np.ones((FRAMES, POINTS), bool), ORTHOGRAPHIC, estimate_focal=False)
    assert found is not None
    assert found.rest.kind == "isometric"
    assert not found.camera.perspective
    mirrored = S * np.array([1.0, 1.0, -1.0])[:, None]
    assert min(expected_error(found, W, S), expected_error(found, W, mirrored)) < 0.12


def test_a_sheet_before_an_orthographic_camera_is_where_its_points_are() -> None:
    _, S, _ = waving()
    W = 300 * (S - S.mean(axis=2, keepdims=True))[:, :2] + np.array([320.0, 240.0])[:, None]
    visible = np.ones(POINTS, bool)
    found = map_of(W, np.ones((FRAMES, POINTS), bool), Camera(), estimate_focal=False)
    assert found is not None
    model = build_model(found.rest, found.camera, 20)
    for w in W:
        state = found.expected(model, found.foreseen([(w, visible)])[0], None)
        assert state is not None
        assert np.median(np.linalg.norm(model.projection(state) - w, axis=0)) < 0.01 * np.ptp(W)
    motion = found.rest.motion
    posed = motion.s[:, None, None] * motion.R @ motion.shape
    np.testing.assert_allclose((posed[:, :2] + motion.t[:, :, None]).mean(axis=(0, 2)), [320, 240], atol=10)


def test_a_solid() -> None:
    rng = np.random.default_rng(3)
    rest = relief(rng, 120)
    W, placed = seen(np.repeat(rest[None], 16, axis=0), turns(16, 30.0), PERSPECTIVE)
    W = W + rng.normal(0, 0.1, W.shape)
    found = map_of(W, np.ones((16, 120), bool), PERSPECTIVE, estimate_focal=False)
    assert found is not None
    assert found.rest.kind == "rigid"
    assert e3d(found.rest.motion.shape[None], placed[:1])[0] < 0.03
    assert found.foreseen([(W[0], np.ones(120, bool))]) == [None]


@pytest.mark.parametrize(("degrees", "told"), [(40.0, True), (8.0, False)])
def test_a_flat_sheet_is_told_once_it_has_turned_with_its_focal_length(degrees: float, told: bool) -> None:
    rng = np.random.default_rng(3)
    W, placed = seen(np.repeat(flat(rng, 120)[None], 16, axis=0), turns(16, degrees), PERSPECTIVE)
    W = W + rng.normal(0, 0.1, W.shape)
    assumed = replace(PERSPECTIVE, focal_px=1.2 * PERSPECTIVE.focal_px)
    found = map_of(W, np.ones((16, 120), bool), assumed, estimate_focal=True, kind=None if told else "flat")
    assert (found is not None) == told
    if found is not None:
        assert found.rest.kind == "plane"
        assert found.is_sheet
        assert e3d(found.rest.motion.shape[None], placed[:1])[0] < 0.01
        assert found.camera.focal_px == pytest.approx(PERSPECTIVE.focal_px, rel=0.03)
        assert found.rest.note.startswith("flat sheet from 16 keyframes")


@pytest.mark.parametrize("deforms", [False, True])
def test_a_solid_holds_the_focal_length_also_if_it_deforms(deforms: bool) -> None:
    rng = np.random.default_rng(3)
    swell = 1 + 0.08 * deforms * rng.normal(size=(16, 1, 1)) * np.array([[1.0], [-1.0], [1.0]])
    W, _ = seen(swell * relief(rng, 120), turns(16, 30.0), PERSPECTIVE)
    W = W + rng.normal(0, 0.1, W.shape)
    assumed = replace(PERSPECTIVE, focal_px=600.0)
    found = map_of(W, np.ones((16, 120), bool), assumed, estimate_focal=True, kind="solid")
    assert found is not None
    assert found.camera.focal_px == pytest.approx(PERSPECTIVE.focal_px, rel=0.1)
    assert "16 keyframes and what is usual" in found.focal_note


def test_a_focal_length_that_is_only_assumed_is_told_to_be() -> None:
    W, _, _ = waving()
    no_lens = replace(CAMERA, focal_px=6 * CAMERA.focal_px)  # what lengths ask for is out of the range of those there are
    found = map_of(W[::2], np.ones((FRAMES // 2, POINTS), bool), no_lens, estimate_focal=True, kind="sheet")
    assert found is not None
    assert found.camera.focal_px == no_lens.focal_px
    assert found.focal_note.startswith(f"focal length {no_lens.focal_px:.0f} px assumed")


def test_what_it_is_may_be_told() -> None:
    W, _, _ = waving()
    found = map_of(W[::2], np.ones((FRAMES // 2, POINTS), bool), CAMERA, estimate_focal=False, kind="solid")
    assert found is not None
    assert found.rest.kind == "rigid"
    assert found.evidence is not None
    assert found.evidence.kind == "sheet"  # is said all the same


def test_a_map_in_another_size_is_the_same_picture() -> None:
    W, _, found = waving()
    larger = found.scaled(3.0)
    assert ratio_of_sizes(larger.rest.motion.shape, found.rest.motion.shape) == pytest.approx(3.0)
    images = []
    for one in (found, larger):
        model = build_model(one.rest, one.camera, 20)
        state = one.expected(model, one.foreseen([(W[1], np.ones(POINTS, bool))])[0], None)
        assert state is not None
        images.append(model.projection(state))
    np.testing.assert_allclose(images[0], images[1], atol=1e-3)


@pytest.mark.parametrize("turned_away", [False, True])
def test_modes_made_beforehand_are_those_made_in_time(turned_away: bool) -> None:
    found, settings = waving()[2], Settings()
    if turned_away:  # in the pose that comes first then, its back is seen
        motion = found.rest.motion
        R = np.concatenate([motion.R[:1], np.diag([-1.0, 1.0, -1.0]) @ motion.R[1:]])
        found = replace(found, rest=replace(found.rest, motion=replace(motion, R=R)))
    order = np.arange(len(found.rest.motion.s))[::-1]
    beforehand = replace(found, model=found.modelled(settings)).in_order(order).scaled(3.0)
    assert beforehand.model is not None
    in_time = found.in_order(order).scaled(3.0).modelled(settings)
    assert beforehand.model.scale == pytest.approx(in_time.scale)
    np.testing.assert_array_equal(beforehand.model.mesh.faces, in_time.mesh.faces)
    np.testing.assert_allclose(beforehand.model.basis.rest, in_time.basis.rest)
    span, other = beforehand.model.basis.Upsilon, in_time.basis.Upsilon
    np.testing.assert_allclose(span.T @ span, other.T @ other, atol=1e-6)


def test_what_lies_behind_the_camera_is_no_map(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = relief(np.random.default_rng(3), 120)
    W, _ = seen(np.repeat(shape[None], 16, axis=0), turns(16), PERSPECTIVE)
    visible = np.ones((16, 120), bool)
    assert map_of(W, visible, PERSPECTIVE, estimate_focal=False) is not None

    def behind(*asked: Any, **how: Any) -> Solid:
        return replace(bundle_adjust(*asked, **how), energy=np.inf)

    monkeypatch.setattr("reconstruction.mapping.maps.bundle_adjust", behind)
    assert map_of(W, visible, PERSPECTIVE, estimate_focal=False) is None


def test_too_few_keyframes_tell_nothing() -> None:
    W, _, _ = waving()
    assert map_of(W[:5], np.ones((5, POINTS), bool), CAMERA, estimate_focal=False) is None


def test_the_medoid_is_nearest_to_all() -> None:
    rng = np.random.default_rng(1)
    shape = rng.normal(size=(3, 30))
    shapes = np.stack([shape + k * rng.normal(size=(3, 30)) for k in (0.5, 0.5, 0.0, 0.5)])
    assert medoid(shapes) == 2


def test_unknown_points_are_where_their_neighbours_are() -> None:
    shape = np.array([[0.0, 1.0, np.nan, 5.0, 1.0], [0.0, 0.0, np.nan, 5.0, 1.0], [0.0, 0.0, np.nan, 5.0, 0.0]])
    like = np.array([[0.0, 1.0, 0.5, 9.0, 1.0], [0.0, 0.0, 0.5, 9.0, 1.0], [0.0, 0.0, 0.0, 9.0, 0.0]])
    whole = completed(shape, like)
    assert np.isfinite(whole).all()
    np.testing.assert_array_equal(whole[:, [0, 1, 3, 4]], shape[:, [0, 1, 3, 4]])
    assert completed(whole, like) is whole


@pytest.mark.parametrize("step_px", [2.0, 40.0])
def test_points_that_belong_to_nothing_break_nothing(step_px: float) -> None:
    rng = np.random.default_rng(1)
    W = 250 + 60 * rng.standard_normal((1, 2, 60)) + np.cumsum(step_px * rng.standard_normal((14, 2, 60)), axis=0)
    found = map_of(W, np.ones((14, 60), bool), PERSPECTIVE, estimate_focal=True)
    assert found is None or np.isfinite(found.rest.motion.shape).all()
