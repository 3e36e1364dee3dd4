"""Priors by name: their weights, how they go together, and that each does what its name says."""

from pathlib import Path

import numpy as np
import pytest

from reconstruction import ReconstructionError
from reconstruction.basis import rest_shape
from reconstruction.camera import Camera
from reconstruction.estimate import ShapeEstimate
from reconstruction.online import Reconstruction
from reconstruction.settings import Deformation, Settings
from reconstruction.window.energy import build_energy
from reconstruction.window.priors import PRIORS, Weights, table, weights
from reconstruction.window.window import SlidingWindow
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, model_of, relief, seen, turns

POINTS, FRAMES = 60, 12
DOCUMENT = Path(__file__).parents[3] / "docs" / "priors.md"


def estimates(chosen: Weights, camera: Camera = PERSPECTIVE) -> list[ShapeEstimate]:
    """Of a hilly surface that turns, moves away and grows higher."""
    rest = relief(np.random.default_rng(0), POINTS)
    shapes = rest * np.stack([[[1.0], [1.0], [1 + 0.04 * f]] for f in range(FRAMES)])
    W, _ = seen(shapes, turns(FRAMES), camera)
    W = W * np.linspace(1, 0.9, FRAMES)[:, None, None]
    settings = Settings(modes=8, deformation="general", priors=chosen)
    reconstruction = Reconstruction(camera, settings, rest_shape.given(rest, "truth", ""))
    return [reconstruction.update(w, np.ones(POINTS, bool))[0] for w in W]


@pytest.mark.parametrize(
    ("deformation", "perspective", "paper", "rest", "smoothness", "rotation", "scale", "inextensibility"),
    [
        ("bending", False, False, 5e-3, 1e-3, 3e-4, 1.0, 0.0),
        ("stretching", False, False, 8e-3, 5.0, 3e-4, 1.0, 0.0),
        ("general", True, False, 8e-3, 5.0, 1e-4, 1e-2, 0.0),
        ("inextensible", True, False, 3e-4, 1e-4, 3e-4, 1e-3, 1.0),
        ("inextensible", False, True, 0.0, 1e-3, 3e-4, 1.0, 0.0),
        ("bending", False, True, 0.0, 1e-3, 3e-4, 1.0, 0.0),
    ],
)
def test_weights_unless_given(
    deformation: str,
    perspective: bool,
    paper: bool,
    rest: float,
    smoothness: float,
    rotation: float,
    scale: float,
    inextensibility: float,
) -> None:
    expected = {
        "rest": rest,
        "smoothness": smoothness,
        "rotation": rotation,
        "scale": scale,
        "inextensibility": inextensibility,
    }
    assert expected.items() <= weights({}, deformation, perspective=perspective, paper=paper).items()


@pytest.mark.parametrize("paper", [False, True])
def test_given_weights_replace_only_those_named(paper: bool) -> None:
    usual = weights({}, "general", perspective=False, paper=paper)
    given = weights({"rest": 0.5, "inextensibility": 1.0}, "general", perspective=False, paper=paper)
    assert given == usual | {"rest": 0.5, "inextensibility": 1.0}


@pytest.mark.parametrize(
    ("chosen", "words"),
    [
        ({"smooth": 1.0}, "no prior smooth: choose from rest, smoothness, rotation"),
        ({"rest": -0.1}, "-0.1 is no weight for the prior rest"),
        ({"scale": float("inf")}, "inf is no weight for the prior scale"),
    ],
)
def test_what_is_no_prior_is_refused_before_the_first_frame(chosen: Weights, words: str) -> None:
    with pytest.raises(ReconstructionError, match=words):
        Reconstruction(PERSPECTIVE, Settings(priors=chosen))


def test_every_prior_is_a_weight_of_the_energy() -> None:
    model = model_of(relief(np.random.default_rng(0), POINTS), ORTHOGRAPHIC, 5)
    for name in PRIORS:
        energy = build_energy(model, "general", {name: 0.123})
        if (residual := PRIORS[name].residual) is not None:
            assert (0.123, residual) in energy.residuals
            continue
        assert np.exp(np.log(getattr(energy, name)).mean()) == pytest.approx(0.123)  # rest: over the modes


@pytest.mark.parametrize(
    ("deformation", "chosen", "kept"),
    [
        ("general", {}, False),
        ("general", {"inextensibility": 1.0}, True),
        ("inextensible", {}, True),
        ("inextensible", {"inextensibility": 0.0}, False),
    ],
)
def test_lengths_are_kept_where_their_prior_has_weight(deformation: Deformation, chosen: Weights, kept: bool) -> None:
    model = model_of(relief(np.random.default_rng(0), POINTS), PERSPECTIVE, 5)
    assert (build_energy(model, deformation, chosen).edges is not None) == kept


def test_each_prior_holds_what_it_is_named_after() -> None:
    def spread(name: str, value: float) -> float:
        found = estimates({name: value}, ORTHOGRAPHIC)
        states = {
            "rest": [one.Lambda for one in found],
            "smoothness": list(np.diff([one.Lambda for one in found], axis=0)),
            "rotation": list(np.diff([one.R for one in found], axis=0)),
            "scale": list(np.diff([one.s for one in found])),
        }
        return float(np.linalg.norm(states[name]))

    for name in ("rest", "rotation", "scale"):
        assert spread(name, 100.0) < 0.5 * spread(name, 0.0), name
    assert spread("smoothness", 100.0) < 0.7 * spread("smoothness", 0.0)  # new frames go on to improve one lasting shape


@pytest.mark.parametrize(
    ("noise_px", "deformation", "factor"), [(0.0, "general", 1), (6.0, "general", 3), (6.0, "inextensible", 1)]
)
def test_what_is_left_over_pulls_to_rest(noise_px: float, deformation: Deformation, factor: float) -> None:
    rng = np.random.default_rng(0)
    rest = relief(rng, POINTS)
    model = model_of(rest, PERSPECTIVE, 5)
    W, _ = seen(np.broadcast_to(rest, (FRAMES, 3, POINTS)), turns(FRAMES), PERSPECTIVE)
    energy = build_energy(model, deformation)
    window = SlidingWindow(model, energy, 3, rest_shape.given(rest, "truth", "").motion)
    for w in W + rng.normal(0, noise_px, W.shape):
        window.advance(w, np.ones(POINTS, bool))
    np.testing.assert_allclose(window._energy.rest, factor * energy.rest)


def test_the_document_lists_the_priors_as_they_are() -> None:
    assert table() in DOCUMENT.read_text()
