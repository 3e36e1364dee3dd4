"""Standard deviations of vertices: about as large as the errors, and larger where less is known."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.camera import Camera
from reconstruction.evaluation import error_over_sigma
from reconstruction.state import State
from reconstruction.window.energy import build_energy
from reconstruction.window.statistics import image_statistics, stack
from reconstruction.window.uncertainty.uncertainty import Uncertainty
from tests.reconstruction.runs import SETTINGS, reconstruct, shapes_of, swelling_hill
from tests.reconstruction.world import ORTHOGRAPHIC, PERSPECTIVE, bending_sheet, model_of, relief, seen

UNSURE = replace(SETTINGS, uncertainty=True)


def noisy(W: np.ndarray, noise_px: float) -> np.ndarray:
    return W + np.random.default_rng(1).normal(0, noise_px, W.shape)


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("noise_px", [0.1, 1.0])
@pytest.mark.parametrize("scene", [bending_sheet, swelling_hill])
def test_errors_are_as_large_as_predicted(scene, noise_px: float, camera: Camera) -> None:  # type: ignore[no-untyped-def]
    W, truth = scene(camera)
    _, estimates = reconstruct(noisy(W, noise_px), camera, UNSURE, truth)
    sigma = np.stack([e.sigma for e in estimates if e.sigma is not None])
    settled = slice(18, None)  # both deform
    assert 0.4 < error_over_sigma(shapes_of(estimates)[settled], sigma[settled], truth[settled]) < 2.8


def test_what_is_hidden_is_less_sure() -> None:
    W, truth = swelling_hill()
    W, visible = noisy(W, 0.3), np.ones((len(W), W.shape[2]), bool)
    left = truth[0, 0] < np.quantile(truth[0, 0], 0.3)
    shown = reconstruct(W, PERSPECTIVE, UNSURE, truth, visible)[1][-1].sigma
    visible[18:, left] = False
    hidden = reconstruct(W, PERSPECTIVE, UNSURE, truth, visible)[1][-1].sigma
    assert shown is not None
    assert hidden is not None
    assert (hidden / shown)[left].mean() > 1.1 * (hidden / shown)[~left].mean()
    visible[20] = False
    _, estimates = reconstruct(W, PERSPECTIVE, UNSURE, truth, visible)
    assert all(e.sigma is not None and np.isfinite(e.sigma).all() for e in estimates)


def test_a_focal_length_that_was_looked_for_makes_all_of_it_less_sure() -> None:
    rng = np.random.default_rng(0)
    shape = relief(rng, 60)
    model = model_of(shape, PERSPECTIVE, 8)
    W, _ = seen(shape[None], np.eye(3)[None], PERSPECTIVE)
    W, visible = noisy(W, 0.5)[0], np.ones(60, bool)
    state = State(np.array([[1.0, 0, 0, 0]]), np.zeros((1, 2)), np.zeros(1), 0.01 * rng.normal(size=(1, 3, 8)))
    data = stack([image_statistics(model, W, np.ones(60))])
    energy = build_energy(model, "general", {})
    given, found = (Uncertainty(model, by).sigma(energy, data, state, W, visible) for by in (0.0, 0.03))
    np.testing.assert_allclose(found**2 - given**2, (0.03 * model.radius) ** 2)


def test_it_takes_the_units_of_the_shape() -> None:
    W, truth = bending_sheet()
    sigmas = [reconstruct(noisy(W, 0.3), PERSPECTIVE, UNSURE, unit * truth)[1][-1].sigma for unit in (1.0, 1e-3)]
    assert sigmas[0] is not None
    np.testing.assert_allclose(sigmas[1], 1e-3 * sigmas[0], rtol=1e-5)


@pytest.mark.parametrize("options", [{"deformation": "bending"}, {"energy": "paper"}, {"deformation": "stretching"}])
def test_every_energy_has_it(options: dict[str, str]) -> None:
    W, truth = bending_sheet(ORTHOGRAPHIC)
    _, estimates = reconstruct(noisy(W, 0.3), ORTHOGRAPHIC, replace(UNSURE, **options), truth)  # type: ignore[arg-type]
    assert all(e.sigma is not None and (e.sigma > 0).all() and np.isfinite(e.sigma).all() for e in estimates)


def test_nothing_unless_asked_for() -> None:
    W, truth = bending_sheet(frames=3)
    assert all(e.sigma is None for e in reconstruct(W, truth=truth)[1])
