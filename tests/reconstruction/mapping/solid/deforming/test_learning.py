"""Deformations of a solid, learned from its keyframes: deeper than images alone tell, and none where there are none."""

import numpy as np
import pytest

from reconstruction.arrays import Array, Mask
from reconstruction.basis.model import facing
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.evaluation import e3d
from reconstruction.mapping.map import Map
from reconstruction.mapping.mapper import on_the_way
from reconstruction.mapping.maps import map_of
from reconstruction.mapping.solid.deforming import learned_map, rounds
from reconstruction.mapping.solid.deforming.attempt import Shown, begun
from reconstruction.mapping.solid.deforming.learned_map import much_better, with_deformations
from reconstruction.mapping.solid.deforming.learning import POINTS, learned
from reconstruction.mapping.solid.solid import bundle_adjust
from reconstruction.settings import Settings
from reconstruction.state import State
from reconstruction.window.normal import inverted
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, relief, seen, turns

K, P = 30, 150
FRAMES = np.arange(K)


def keyframes(deform: float, camera: Camera = PERSPECTIVE, points: int = P) -> tuple[Array, Array, Mask]:
    """Shapes (K, 3, p) of a relief with three bumps that come and go, and its images with noise and gaps."""
    rng = np.random.default_rng(3)
    rest = relief(rng, points)
    width = np.ptp(rest[0])
    shapes = np.repeat(rest[None], K, axis=0)
    for centre in rest[:2, rng.choice(points, 3)].T:
        bump = np.exp(-((rest[:2] - centre[:, None]) ** 2).sum(axis=0) / (0.2 * width) ** 2)
        way = rng.normal(size=3)
        course = np.sin(np.arange(K) * rng.uniform(0.5, 1.5))[:, None, None]
        shapes = shapes + deform * width * course * way[:, None] / np.linalg.norm(way) * bump
    W, posed = seen(shapes, turns(K), camera)
    return posed, W + 0.2 * rng.normal(size=W.shape), rng.random((K, points)) > 0.1


def mapped(W: Array, visible: Mask, camera: Camera) -> Map:
    solid = bundle_adjust(np.where(visible[:, None], W, np.nan), visible, camera, refine_focal=False)
    return Map(RestShape("rigid", solid.motion, "made here"), solid.camera)


def shown(rigid: Map, W: Array, visible: Mask) -> Shown:
    return Shown(rigid, Settings(), W, visible, visible, FRAMES)


def turned(B: Array, state: State) -> Array:
    return state.scaled_rotations() @ (B[:3] + state.Lambda @ B[3:-1])


@pytest.mark.parametrize("camera", [PERSPECTIVE, pytest.param(ORTHOGRAPHIC, marks=pytest.mark.slow)])
def test_depth_of_deformations_is_learned(camera: Camera) -> None:
    shapes, W, visible = keyframes(0.06, camera)
    found = mapped(W, visible, camera)
    model, before = begun(found, shown(found, W, visible))
    after = learned(model, W, visible, before, before.log_s)
    errors = [e3d(turned(B, state), shapes).mean() for B, state in ((model.B, before), (after.B, after.state))]
    assert errors[1] < 0.75 * errors[0]


def test_it_takes_fewer_rounds_since_two_tell_where_they_lead_to(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes, W, visible = keyframes(0.06)
    found = mapped(W, visible, PERSPECTIVE)
    model, before = begun(found, shown(found, W, visible))
    quick = learned(model, W, visible, before, before.log_s, rounds=16)
    monkeypatch.setattr(rounds, "extrapolated", lambda *path: path[-1])
    slow = learned(model, W, visible, before, before.log_s, rounds=16)
    errors = [e3d(turned(known.B, known.state), shapes).mean() for known in (quick, slow)]
    assert errors[0] < 0.9 * errors[1]


def test_dense_points_are_placed_by_those_they_are_learned_from() -> None:
    shapes, W, visible = keyframes(0.06, points=POINTS + 200)
    found = mapped(W, visible, PERSPECTIVE)
    model, before = begun(found, shown(found, W, visible))
    after = learned(model, W, visible, before, before.log_s, rounds=20)
    assert e3d(turned(after.B, after.state), shapes).mean() < 0.9 * e3d(turned(model.B, before), shapes).mean()


def test_rigid_things_learn_nothing() -> None:
    _, W, visible = keyframes(0.0)
    found = mapped(W, visible, PERSPECTIVE)
    assert with_deformations(found, Settings(), W, visible, FRAMES) is found


@pytest.mark.parametrize(("part", "deforms"), [(0.05, True), (0.01, False)])
def test_a_part_that_moves_by_itself_is_predicted_but_for_a_few_points(part: float, deforms: bool) -> None:
    """However far off those are; and a few that are put right where all drift are no part."""
    then, now = np.full((2, 1000), 0.001)
    then[: int(1000 * part)], now[: int(1000 * part)] = 0.15, 0.02
    then[: int(200 * part)] = now[: int(200 * part)] = 0.3
    assert much_better(now, then) == deforms
    assert not much_better(0.9 * then, then)


@pytest.mark.parametrize(
    "settings", [Settings(deformation="stretching"), Settings(priors={"rest": 1.0}), Settings(priors={"smoothness": 1.0})]
)
def test_what_was_asked_for_stays(settings: Settings) -> None:
    _, W, visible = keyframes(0.06)
    found = mapped(W, visible, PERSPECTIVE)
    assert with_deformations(found, settings, W, visible, FRAMES) is found


@pytest.mark.slow
def test_keyframes_stay_in_the_order_of_the_map() -> None:
    _, W, visible = keyframes(0.06)
    order = np.random.default_rng(5).permutation(K)
    found = mapped(W[order], visible[order], PERSPECTIVE)
    known = with_deformations(found, Settings(), W[order], visible[order], FRAMES[order])
    assert known.deformations is not None
    turn = known.rest.motion.R @ known.rest.motion.R[0].T @ found.rest.motion.R[0] @ found.rest.motion.R.swapaxes(1, 2)
    assert np.degrees(np.arccos((np.trace(turn, axis1=1, axis2=2).clip(-1, 3) - 1) / 2)).max() < 10


@pytest.mark.parametrize("camera", [PERSPECTIVE, pytest.param(ORTHOGRAPHIC, marks=pytest.mark.slow)])
def test_on_the_way_the_rest_shape_is_learned_too(camera: Camera) -> None:
    """Without what deformations are like: the Gaussian knows none that are to come."""
    shapes, W, visible = keyframes(0.09, camera)
    asked = np.where(visible[:, None], W, np.nan), visible
    rigid, found = map_of(*asked, camera, False), on_the_way(Settings(), *asked, FRAMES, camera, False)
    assert rigid is not None
    assert found is not None
    assert found.model is not None
    assert found.deformations is None
    errors = [e3d(np.repeat(one.rest.motion.shape[None], K, axis=0), shapes).mean() for one in (rigid, found)]
    assert errors[1] < 0.9 * errors[0]
    assert errors[1] < 0.058


@pytest.mark.slow
def test_the_mirror_image_has_the_mirrored_deformations() -> None:
    _, W, visible = keyframes(0.06, ORTHOGRAPHIC)
    known = with_deformations(mapped(W, visible, ORTHOGRAPHIC), Settings(), W, visible, FRAMES)
    assert known.model is not None
    assert known.deformations is not None
    flip = np.array([1.0, 1.0, -1.0])[:, None]
    motion = known.rest.motion
    other = known.turned_like(flip * (motion.R[0] @ motion.shape))
    assert other.model is not None
    assert other.deformations is not None
    Lambda = np.random.default_rng(0).normal(size=(3, len(known.model.basis.eigenvalues)))
    mirrored = flip * Lambda
    assert other.model.basis.deform(mirrored) == pytest.approx(flip * known.model.basis.deform(Lambda))
    pulls = [one.pull(P).form for one in (known.deformations, other.deformations)]
    costs = [row.ravel() @ form @ row.ravel() for row, form in zip((Lambda, mirrored), pulls, strict=True)]
    assert costs[0] == pytest.approx(costs[1])
    np.testing.assert_array_equal(other.model.mesh.faces, facing(known.model.mesh, other.rest.motion).faces)


def test_points_that_no_gaussian_holds_leave_the_map_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    _, W, visible = keyframes(0.06)
    found = mapped(W, visible, PERSPECTIVE)

    def fails(*_: object) -> None:
        inverted(-np.eye(2))

    monkeypatch.setattr(learned_map, "learned", fails)
    assert with_deformations(found, Settings(), W, visible, FRAMES) is found
