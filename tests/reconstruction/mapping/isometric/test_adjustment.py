"""A sheet of unknown shape from its keyframes: accuracy, units, gaps, gross errors, strays, focal length."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from reconstruction import ReconstructionError
from reconstruction.camera import Camera
from reconstruction.evaluation import e3d
from reconstruction.mapping.isometric.adjustment import bundled, by_part, in_halves, sheet
from reconstruction.mapping.isometric.bundle import GIVE
from reconstruction.mapping.isometric.focal import under_its_focal_length
from reconstruction.mapping.isometric.one_frame import cheapest, shape_in
from reconstruction.mapping.isometric.sheet import IsometricSheet
from tests.reconstruction.mapping.bending import CAMERA, stretching_sheet, waving_sheet
from tests.reconstruction.world import turns, views

SEEN = np.ones((12, 150), bool)


@cache
def waving() -> tuple[np.ndarray, np.ndarray, IsometricSheet]:
    W, S = waving_sheet(np.random.default_rng(5))
    return W, S, sheet(W, SEEN, CAMERA)


def error(found: IsometricSheet, truth: np.ndarray) -> float:
    return float(e3d(found.shapes(), truth).mean())


def in_frames(found: IsometricSheet, W: np.ndarray) -> np.ndarray:
    return np.stack([shape_in(found, w, np.ones(W.shape[2], bool)).shape for w in W])


def test_shapes_come_out_of_the_images_alone() -> None:
    _, S, found = waving()
    assert error(found, S) < 0.02
    assert found.strain_rms < 0.01
    assert np.median(found.edge_weights) > 0.5


def test_lengths_are_those_of_the_sheet() -> None:
    _, S, found = waving()
    place = found.nodes.reference
    nodes = np.linalg.norm(found.warps.reference[:, :, None] - place[:, None], axis=0).argmin(axis=0)
    i, j = nodes[found.nodes.ends].T
    true = np.log(np.linalg.norm(S[:, :, i] - S[:, :, j], axis=1)).mean(axis=0)
    ratio = found.log_lengths - true
    assert np.std(ratio - np.median(ratio)) < 0.05


def test_a_half_of_the_keyframes_can_be_told_the_lengths_of_the_other() -> None:
    W, _, found = waving()
    halves = np.arange(0, len(W), 2), np.arange(1, len(W), 2)
    shapes, *_ = in_halves(found, W, halves)
    i, j = found.nodes.points[found.nodes.ends].T
    for (_, through, told), (made, _, _), half in zip(shapes, shapes[::-1], halves, strict=True):
        alone, by_them, theirs = (np.log(np.linalg.norm(S[:, :, i] - S[:, :, j], axis=1)) for S in (through, told, made))
        assert np.std(by_them - np.median(theirs, axis=0)) < np.std(alone - np.median(theirs, axis=0))
        np.testing.assert_allclose(CAMERA.focal_px * told[:, :2] / told[:, 2:] + CAMERA.center_px[:, None], W[half])


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_units_of_the_image_do_not_matter(unit: float) -> None:
    W, _, found = waving()
    camera = Camera(CAMERA.focal_px * unit, CAMERA.center_px * unit)
    again = sheet(W * unit, SEEN, camera)
    np.testing.assert_allclose(again.shapes(), found.shapes(), rtol=1e-5)


def test_frames_that_were_no_keyframes_are_finished_with_the_lengths_known() -> None:
    W, S, _ = waving()
    found = sheet(W[::2], SEEN[::2], CAMERA)
    assert float(e3d(in_frames(found, W[1::2]), S[1::2]).mean()) < 0.05


def test_gaps_and_gross_errors_are_lived_with() -> None:
    rng = np.random.default_rng(3)
    W, S = waving_sheet(rng, frames=20, points=250, noise_px=0.5)
    visible = rng.random((20, 250)) > 0.4
    gross = rng.random((20, 250)) < 0.1
    W = np.where(gross[:, None], rng.uniform(100, 400, W.shape), W)
    found = sheet(np.where(visible[:, None], W, np.nan), visible, CAMERA)
    assert error(found, S) < 0.05
    assert (found.warps.weights[gross & visible] > 0.25).mean() < 0.1


def test_points_as_they_were_seen_and_lengths_adjusted_together_tell_more() -> None:
    rng = np.random.default_rng(8)
    W, S = waving_sheet(rng, frames=20, points=250, noise_px=0.5)
    visible = rng.random((20, 250)) > 0.4
    found = sheet(np.where(visible[:, None], W, np.nan), visible, CAMERA)
    together = bundled(found, W)
    assert error(together, S) < 0.85 * error(found, S)
    i, j = found.nodes.points[found.nodes.ends].T
    true = np.log(np.linalg.norm(S[:, :, i] - S[:, :, j], axis=1)).mean(axis=0)
    before, after = (np.std(one.log_lengths - true) for one in (found, together))
    assert after < 0.85 * before


def test_points_that_slip_together_count_by_the_shapes_not_by_smooth_images(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    W, S = waving_sheet(rng, frames=20, points=250, noise_px=0.3)
    for w in W[::2]:
        near = np.linalg.norm(w - w[:, [rng.integers(250)]], axis=0).argsort()[:8]
        w[:, near] += 6 * rng.standard_normal((2, 1))
    found = sheet(W, np.ones((20, 250), bool), CAMERA)
    by_shapes = error(bundled(found, W), S)
    by_images = found.weighed(found.shapes(), W, np.ones((20, 250), bool))
    monkeypatch.setattr(IsometricSheet, "weighed", lambda *_: by_images)
    assert by_shapes < 0.8 * error(bundled(found, W), S)


def test_a_frame_is_right_though_its_keyframe_is_in_another_minimum() -> None:
    W, S, found = waving()
    frame = 3
    coefficients = found.coefficients.copy()
    coefficients[frame] = found.coefficients[np.argmax([e3d(s[None], S[frame : frame + 1])[0] for s in found.shapes()])]
    wrong = replace(found, coefficients=coefficients)
    assert e3d(wrong.shapes(), S)[frame] > 0.1
    shape = shape_in(bundled(wrong, W, rounds=1), W[frame], SEEN[frame]).shape
    assert float(e3d(shape[None], S[frame : frame + 1])[0]) < 0.03


def test_points_of_something_else_count_for_little_and_spoil_nothing() -> None:
    rng = np.random.default_rng(4)
    W, S = waving_sheet(rng, frames=15, points=200)
    still = np.stack([W[0, 0].min() - rng.uniform(2, 30, 14), rng.uniform(200, 300, 14)])
    W = np.concatenate([W, np.broadcast_to(still, (15, 2, 14)) + 0.1 * rng.standard_normal((15, 2, 14))], axis=2)
    found = sheet(W, np.ones((15, 214), bool), CAMERA)
    strange = (found.nodes.points[found.nodes.ends] >= 200).any(axis=1)
    assert np.median(found.edge_weights[strange]) < 0.3
    assert np.median(found.edge_weights[~strange]) > 0.5
    assert float(e3d(found.shapes()[:, :, :200], S).mean()) < 0.03


def test_part_that_is_out_of_sight_does_not_spoil_the_rest() -> None:
    rng = np.random.default_rng(6)
    W, S = waving_sheet(rng, frames=15, points=200)
    visible = np.ones((15, 200), bool)
    visible[3:6] = W[0, 0] < np.median(W[0, 0])
    found = sheet(np.where(visible[:, None], W, np.nan), visible, CAMERA)
    whole = visible.all(axis=1)
    assert float(e3d(found.shapes()[whole], S[whole]).mean()) < 0.03


@pytest.mark.parametrize("off", [0.4, 2.5, *(pytest.param(off, marks=pytest.mark.slow) for off in (0.7, 0.8, 1.25, 2.0))])
def test_lengths_hold_the_focal_length(off: float) -> None:
    W, S, _ = waving()
    wrong = sheet(W, SEEN, replace(CAMERA, focal_px=off * CAMERA.focal_px))
    found = under_its_focal_length(wrong)
    assert found is not wrong
    assert found.camera.focal_px == pytest.approx(CAMERA.focal_px, rel=0.05)
    assert error(found, S) < 0.02


def test_fewer_views_tell_less_of_the_focal_length() -> None:
    W, _, given = waving()
    all_of_them, few = (
        under_its_focal_length(sheet(W[:n], SEEN[:n], replace(CAMERA, focal_px=1.25 * CAMERA.focal_px))) for n in (12, 5)
    )
    assert given.by_focal == 0.0
    assert 0.0 < 1.5 * all_of_them.by_focal < few.by_focal < 0.02
    assert bundled(few, W[:5], rounds=1).by_focal == few.by_focal


def test_what_cannot_be_done_is_said() -> None:
    W, _, _ = waving()
    with pytest.raises(ReconstructionError, match="perspective"):
        sheet(W, SEEN, Camera())
    with pytest.raises(ReconstructionError, match="3 keyframes"):
        sheet(W[:2], SEEN[:2], CAMERA)


def test_frames_in_another_minimum_are_found_again() -> None:
    W, S, found = waving()
    wrong = replace(found, coefficients=np.flip(found.coefficients, axis=0))  # every frame would start badly
    assert float(e3d(in_frames(wrong, W), S).mean()) < 0.03


def test_a_frame_is_bundled_until_its_shapes_cost_no_less(monkeypatch: pytest.MonkeyPatch) -> None:
    (W, _, found), once, counts = waving(), IsometricSheet.bundled, list[int]()
    weights = np.full(150, found.warps.noise_px[3] ** -2)

    def counted(self: IsometricSheet, shapes: np.ndarray, *others: Any) -> np.ndarray:
        counts.append(len(shapes))
        return once(self, shapes, *others)

    monkeypatch.setattr(IsometricSheet, "bundled", counted)
    cost = found.cost(cheapest(found, found.shapes()[[2, 3]], W[3], weights, 100), W[3], weights)[0]
    assert counts[0] == 2
    assert counts[-1] == 1  # one goes on alone
    assert 2 < len(counts) < 30
    C = found.shapes()[[3]][:, :, found.warps.few] @ found.projector
    for _ in range(100):
        C = once(found, C @ found.functions.T, W[[3]], weights[None], found.prior)
    assert cost < 1.02 * found.cost(C, W[3], weights)[0]


def test_points_of_their_own_are_no_sheet() -> None:
    W, _ = waving_sheet(np.random.default_rng(5), noise_px=6.0)  # some 8 % of its size
    with pytest.raises(ReconstructionError, match="no smooth surface"):
        sheet(W, SEEN, CAMERA)


def test_what_is_seen_through_is_no_sheet_but_noise_may_be_as_large() -> None:
    cloud = 60 * np.random.default_rng(3).normal(size=(3, 150))
    W, _ = views(cloud, turns(12), CAMERA)
    with pytest.raises(ReconstructionError, match="together"):
        sheet(W, SEEN, CAMERA)
    rng = np.random.default_rng(4)
    W, _ = waving_sheet(rng, noise_px=1.5)  # some 2 % of its size
    sheet(W, SEEN, CAMERA)


def test_what_stretches_is_no_sheet() -> None:
    rng = np.random.default_rng(7)
    W, _ = waving_sheet(rng, frames=15)
    W = W + 12 * np.sin(W[:, ::-1] / 20 + rng.uniform(0, 6, (15, 1, 1)))
    with pytest.raises(ReconstructionError, match="lengths change"):
        sheet(W, np.ones((15, 150), bool), CAMERA)


def test_lengths_of_cloth_give_more_than_those_of_paper() -> None:
    W, _, paper = waving()
    assert bundled(paper, W).give == GIVE
    W, _ = stretching_sheet(np.random.default_rng(1), stretch=0.03)
    cloth = sheet(W, np.ones((len(W), W.shape[2]), bool), CAMERA)
    assert bundled(cloth, W).give > 1.5 * GIVE


def test_what_a_frame_hides_follows_shapes_of_keyframes() -> None:
    W, S, found = waving()
    others = by_part(found, np.delete(np.arange(len(W)), 7))
    seen = W[7, 0] < np.quantile(W[7, 0], 0.6)
    shape = shape_in(others, W[7], seen).shape
    assert float(e3d(shape[None], S[7:8]).mean()) < 0.04


def test_shapes_behind_the_camera_are_no_sheet() -> None:
    """Tracks of something else can be explained so; their logarithms of depth would be none."""
    _, _, found = waving()
    shapes = found.shapes()
    shapes[3, 2] *= -1
    with pytest.raises(ReconstructionError, match="behind the camera"):
        found.with_shapes(shapes)
