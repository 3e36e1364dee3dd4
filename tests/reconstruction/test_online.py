"""The on-line estimator: frame by frame, on surfaces whose true shape is known."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction import ReconstructionError
from reconstruction.camera import Camera
from reconstruction.evaluation import e3d, with_missing, with_outliers
from reconstruction.mapping.first.evidence import weigh
from reconstruction.online import Phase, Reconstruction
from reconstruction.settings import Deformation, Settings
from tests.reconstruction.runs import (
    FRAMES,
    POINTS,
    SETTINGS,
    error,
    reconstruct,
    shapes_of,
    static_error,
    still_sheet,
    swelling_hill,
)
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, bending_sheet, flat, relief, seen, turn, turns


@pytest.mark.parametrize(("deformation", "share"), [("inextensible", 0.4), ("bending", 0.7)])
def test_a_bending_sheet_is_followed(deformation: Deformation, share: float) -> None:
    W, truth = bending_sheet()
    reconstruction, estimates = reconstruct(W, settings=replace(SETTINGS, deformation=deformation), truth=truth)
    static = static_error(reconstruction, truth)
    assert static > 0.03
    assert error(estimates, truth) < share * static
    rms = np.sqrt(np.mean([e.residual_px**2 for e in estimates]))
    assert rms < 2.0


def test_auto_takes_a_sheet_for_inextensible() -> None:
    W, truth = bending_sheet()
    reconstruction, estimates = reconstruct(W, truth=truth)
    assert (reconstruction.deformation, reconstruction.metric) == ("inextensible", "chi-squared")
    assert error(estimates, truth) < 0.5 * static_error(reconstruction, truth)


@pytest.mark.parametrize("deformation", ["auto", "bending"])
def test_a_sheet_whose_depth_sign_is_open_stays_on_its_side(deformation: Deformation) -> None:
    W, truth = bending_sheet(ORTHOGRAPHIC)
    settings = replace(SETTINGS, deformation=deformation)
    reconstruction, estimates = reconstruct(W, ORTHOGRAPHIC, settings, truth=truth)
    assert reconstruction.deformation == ("inextensible" if deformation == "auto" else "bending")
    assert error(estimates, truth) < 0.6 * static_error(reconstruction, truth)
    linear = replace(settings, deformation="bending", energy="paper", priors={"rest": 1e-2})
    _, stretched = reconstruct(W, ORTHOGRAPHIC, linear, truth=truth)
    assert error(estimates, truth) < error(stretched, truth)


def test_a_solid_is_factorised_then_deformed() -> None:
    W, truth = swelling_hill(ORTHOGRAPHIC)
    settings = replace(SETTINGS, rest_shape="rigid", bootstrap_frames=12)
    reconstruction, estimates = reconstruct(W, ORTHOGRAPHIC, settings)
    assert reconstruction.rest is not None
    assert reconstruction.rest.kind == "rigid"
    assert reconstruction.bootstrap_frames == 12
    assert (reconstruction.deformation, reconstruction.metric) == ("general", "jensen-shannon")
    assert [e.frame for e in estimates] == list(range(FRAMES))
    per_frame = e3d(shapes_of(estimates), truth)
    still = e3d(np.broadcast_to(reconstruction.rest.motion.shape, truth.shape), truth)
    assert per_frame[:15].max() < 0.02  # rigid
    swollen = still > 0.1
    assert swollen.sum() > 5
    # Half of what swells in depth is not seen by an orthographic camera that turns by a few degrees meanwhile.
    assert per_frame[swollen].mean() < 0.85 * still[swollen].mean()


def test_shapes_of_the_bootstrap_come_when_it_is_over() -> None:
    W, _ = swelling_hill()
    reconstruction = Reconstruction(PERSPECTIVE, replace(SETTINGS, rest_shape="rigid", bootstrap_frames=8))
    visible = np.ones(POINTS, bool)
    for f in range(7):
        assert reconstruction.update(W[f], visible) == []
        assert reconstruction.phase is Phase.BOOTSTRAP
        assert reconstruction.predict() is None
    with pytest.raises(ReconstructionError, match="no rest shape yet"):
        _ = reconstruction.model
    assert [e.frame for e in reconstruction.update(W[7], visible)] == list(range(8))
    assert reconstruction.phase is Phase.TRACKING
    assert [e.frame for e in reconstruction.update(W[8], visible)] == [8]
    assert reconstruction.finish() == []


@pytest.mark.parametrize("kind", ["auto", "plane"])
def test_a_source_that_ends_early_still_gets_its_shapes(kind: str) -> None:
    W, _ = bending_sheet()
    reconstruction, estimates = reconstruct(W[:5], settings=replace(SETTINGS, rest_shape=kind))  # type: ignore[arg-type]
    assert [e.frame for e in estimates] == list(range(5))
    assert reconstruction.rest is not None
    assert reconstruction.rest.kind == "plane"
    if kind == "auto":
        assert "too few frames for a rigid shape" in reconstruction.rest.note


@pytest.mark.parametrize("frames", ["auto", 20])
def test_a_still_scene_is_no_rigid_shape(frames: "str | int") -> None:
    settings = replace(SETTINGS, rest_shape="rigid", bootstrap_frames=frames)
    words = r"cannot recover a rest shape: the object turned \d+\.\d° in \d+ frames, about 10° are needed"
    with pytest.raises(ReconstructionError, match=words):
        reconstruct(still_sheet(), settings=settings)


def test_auto_falls_back_to_the_sheet_and_says_so() -> None:
    reconstruction, estimates = reconstruct(still_sheet())
    assert reconstruction.rest is not None
    assert reconstruction.rest.kind == "plane"
    assert "no rigid shape: the object turned" in reconstruction.rest.note
    assert "10° are needed" in reconstruction.rest.note
    assert len(estimates) == 70
    rms = np.sqrt(np.mean([e.residual_px**2 for e in estimates]))
    assert rms < 0.2


def test_auto_finds_a_solid() -> None:
    W, truth = swelling_hill(ORTHOGRAPHIC)
    reconstruction, estimates = reconstruct(W, ORTHOGRAPHIC)
    assert reconstruction.rest is not None
    assert reconstruction.rest.kind == "rigid"
    assert reconstruction.bootstrap_frames <= 15
    assert error(estimates, truth) < 0.06


@pytest.mark.parametrize(
    ("deformation", "energy", "fixed"),
    [("bending", "paper", [0, 1]), ("stretching", "paper", [2]), ("stretching", "anchored", [2])],
)
def test_constraints_are_rows_that_stay_zero(deformation: Deformation, energy: str, fixed: list[int]) -> None:
    W, truth = swelling_hill(ORTHOGRAPHIC)
    settings = replace(SETTINGS, deformation=deformation, energy=energy, refine_rest=False)
    _, estimates = reconstruct(W, ORTHOGRAPHIC, settings, truth=truth)
    Lambda = np.stack([e.Lambda for e in estimates])
    np.testing.assert_array_equal(Lambda[:, fixed], 0.0)
    free = [row for row in range(3) if row not in fixed]
    assert np.abs(Lambda[:, free]).max() > 0.1


def test_in_the_plane_a_bending_sheet_only_draws_in() -> None:
    W, truth = bending_sheet()
    settings = replace(SETTINGS, deformation="bending", refine_rest=False)
    reconstruction, estimates = reconstruct(W, settings=settings, truth=truth)
    Lambda = np.stack([e.Lambda for e in estimates]) / reconstruction.model.unit
    edges = reconstruction.model.coarse_edges()
    strain = np.abs(edges.strain(edges.vectors(Lambda)) / edges.length)
    bent = np.abs(edges.strain(edges.vectors(Lambda * np.array([[0.0], [0.0], [1.0]]))) / edges.length)
    assert np.abs(Lambda[:, :2]).max() > 0
    assert strain.mean() < 0.5 * bent.mean()


def test_inextensible_keeps_the_edges_better_than_general() -> None:
    W, truth = bending_sheet()
    change = {}
    for deformation in ("inextensible", "general"):
        settings = replace(SETTINGS, deformation=deformation)  # type: ignore[arg-type]
        reconstruction, estimates = reconstruct(W, settings=settings, truth=truth)
        i, j = reconstruction.model.mesh.edges.T
        S, rest = shapes_of(estimates), reconstruction.model.basis.rest
        ratio = np.linalg.norm(S[:, :, i] - S[:, :, j], axis=1) / np.linalg.norm(rest[:, i] - rest[:, j], axis=0)
        change[deformation] = np.abs(ratio - 1).mean()
    assert change["inextensible"] < 0.03
    assert change["inextensible"] < change["general"]


@pytest.mark.parametrize("kind", ["plane", "rigid"])
def test_the_size_of_the_picture_does_not_matter_to_the_bootstrap(kind: str) -> None:
    W, _ = swelling_hill()
    settings = replace(SETTINGS, rest_shape=kind, bootstrap_frames=12)  # type: ignore[arg-type]
    _, one = reconstruct(W, settings=settings)
    _, two = reconstruct(2 * W, Camera(2 * PERSPECTIVE.focal_px, 2 * PERSPECTIVE.center_px), settings)
    difference = np.linalg.norm(shapes_of(two) - 2 * shapes_of(one)) / np.linalg.norm(shapes_of(two))
    assert difference < 1e-3


def test_the_same_input_gives_the_same_output() -> None:
    W, _ = bending_sheet()
    np.testing.assert_array_equal(shapes_of(reconstruct(W)[1]), shapes_of(reconstruct(W)[1]))


def test_hidden_points_are_carried_along_by_the_others() -> None:
    W, truth = bending_sheet()
    visible = np.random.default_rng(0).random((FRAMES, POINTS)) >= 0.4
    visible[:2] = True
    reconstruction, estimates = reconstruct(W, truth=truth, visible=visible)
    assert np.isfinite(shapes_of(estimates)).all()
    assert error(estimates, truth) < 0.6 * static_error(reconstruction, truth)
    for estimate, seen_now in zip(estimates, visible, strict=True):
        np.testing.assert_array_equal(estimate.visible, seen_now)
        np.testing.assert_array_equal(np.isfinite(estimate.residual_px), seen_now)


def test_the_papers_energy_keeps_the_scale_and_floats() -> None:
    W, truth = swelling_hill(ORTHOGRAPHIC)
    settings = replace(SETTINGS, energy="paper", deformation="bending")
    _, estimates = reconstruct(W, ORTHOGRAPHIC, settings, truth=truth)
    scales = [e.s for e in estimates]
    assert max(scales) - min(scales) < 1e-9
    assert scales[0] == pytest.approx(1.0, abs=0.02)
    with pytest.raises(ReconstructionError, match="energy paper needs"):
        Reconstruction(PERSPECTIVE, settings)


@pytest.mark.parametrize("modes", [POINTS, 500])
@pytest.mark.parametrize("given", [True, False])
def test_more_modes_than_points_are_refused_at_once(modes: int, given: bool) -> None:
    W, truth = bending_sheet()
    with pytest.raises(ReconstructionError, match=rf"modes {modes} does not fit {POINTS} points"):
        reconstruct(W[:1], settings=Settings(modes=modes), truth=truth if given else None)


@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_a_turning_solid_is_recovered_among_gross_outliers(missing: float) -> None:
    rng = np.random.default_rng(5)
    shape = relief(rng, 60)
    swell = 1 + 0.08 * np.sin(np.arange(40) / 4)[:, None, None] * np.array([[1.0], [0.3], [1.0]])
    W, truth = seen(swell * shape, turns(40, 35.0), PERSPECTIVE)
    visible = with_missing(np.ones((40, 60), bool), missing, rng)
    settings = Settings(rest_shape="rigid", deformation="general")
    errors = {}
    for share in (0.0, 0.15):
        wild = with_outliers(W, visible, share, rng)
        reconstruction, estimates = Reconstruction(PERSPECTIVE, settings), []
        for w, h in zip(wild, visible, strict=True):
            estimates += reconstruction.update(np.where(h, w, np.nan), h)
        errors[share] = error(estimates + reconstruction.finish(), truth)
    assert errors[0.15] < 1.3 * errors[0.0] + 0.005, errors


@pytest.mark.slow
def test_a_sheet_before_something_that_moves_by_itself_is_no_solid() -> None:
    # To an orthographic eye what lies behind, moving by itself, is parallax of a rigid scene.
    rng = np.random.default_rng(3)
    front, behind, k = flat(rng, 60), 1.4 * flat(rng, 60), np.arange(60)
    R = np.stack([turn((8 * np.sin(f / 12 + 0.3), 12 * np.sin(f / 16), 0)) for f in k])
    W_front, _ = seen(np.broadcast_to(front, (60, 3, 60)), R, PERSPECTIVE)
    drift = np.stack([10 * np.sin(k / 20), 6 * np.cos(k / 27)], axis=1)[:, :, None]
    W_behind = behind[:2] + drift + PERSPECTIVE.center_px[:, None]
    W = np.concatenate([W_front, W_behind], axis=2) + rng.normal(0, 0.1, (60, 2, 120))
    assert not weigh(W[:20], np.ones((20, 120), bool)).doubt
    reconstruction, _ = reconstruct(W, settings=Settings(revise=False))
    assert reconstruction.rest is not None
    assert reconstruction.rest.kind == "plane"
