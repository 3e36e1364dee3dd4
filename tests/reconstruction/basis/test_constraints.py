"""Coarse edges and their strain, and sheets that draw in as they bend."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.basis.constraints import Bending, CoarseEdges
from reconstruction.basis.model import Model
from tests.reconstruction.world import ORTHOGRAPHIC, SEEDS, flat, model_of, relief, rolled

POINTS, MODES = 120, 12


def coefficients(model: Model, shape: np.ndarray) -> np.ndarray:
    """Λ' (1, 3, r) nearest to a shape (3, p) that is turned like the rest shape."""
    away = model.basis.Phi.T @ (shape - shape.mean(axis=1, keepdims=True)) - model.radius * model.B[:3]
    return np.asarray(away @ model.basis.Upsilon.T / model.unit)[None]


def strained(edges: CoarseEdges, Lambda: np.ndarray) -> float:
    """RMS strain of the edges, as a share of their length."""
    return float(np.sqrt(((edges.strain(edges.vectors(Lambda)) / edges.length) ** 2).mean()))


@given(SEEDS)
def test_strain_is_the_change_of_length_to_first_order(rng: np.random.Generator) -> None:
    edges = model_of(relief(rng, 25), ORTHOGRAPHIC, 3).coarse_edges(12)
    still = np.zeros((1, 3, 3))
    np.testing.assert_allclose(edges.strain(edges.vectors(still)), 0.0, atol=1e-12)
    vectors = edges.vectors(1e-4 * rng.normal(size=(1, 3, 3)))
    change = np.linalg.norm(vectors[0], axis=0) - edges.length
    np.testing.assert_allclose(edges.strain(vectors)[0], change, atol=1e-6)


@given(SEEDS, st.floats(-0.006, 0.006))
def test_a_rolled_sheet_draws_in_as_it_must(rng: np.random.Generator, curvature: float) -> None:
    sheet = flat(rng, POINTS)
    model = model_of(sheet, ORTHOGRAPHIC, MODES)
    edges = model.coarse_edges()
    truth = coefficients(model, rolled(sheet, curvature))
    bent = truth * np.array([[0.0], [0.0], [1.0]])
    drawn = Bending(edges, np.ones(MODES)).completed(bent)
    np.testing.assert_array_equal(drawn[:, 2], truth[:, 2])
    assert strained(edges, drawn) < 0.4 * strained(edges, bent) + 1e-4
    # Nearer to the truth than the sheet that only moves out of its plane.
    assert np.linalg.norm(drawn - truth) < 0.5 * np.linalg.norm(bent - truth) + 1e-4


@given(SEEDS)
def test_either_side_of_a_flat_sheet_draws_in_alike(rng: np.random.Generator) -> None:
    model = model_of(flat(rng, POINTS), ORTHOGRAPHIC, MODES)
    bending = Bending(model.coarse_edges(), np.ones(MODES))
    bent = 0.1 * rng.normal(size=(2, 3, MODES))
    other = bending.completed(bent * np.array([[1.0], [1.0], [-1.0]]))
    np.testing.assert_allclose(other[:, :2], bending.completed(bent)[:, :2], atol=1e-9)


@given(SEEDS)
def test_what_is_at_rest_stays_there(rng: np.random.Generator) -> None:
    model = model_of(relief(rng, POINTS), ORTHOGRAPHIC, MODES)
    centre = 0.05 * rng.normal(size=(3, MODES))
    edges = model.coarse_edges().about(centre)
    bending = Bending(model.coarse_edges(), np.ones(MODES)).about(centre)
    np.testing.assert_allclose(bending.completed(centre[None])[0], centre, atol=1e-12)
    np.testing.assert_allclose(edges.strain(edges.vectors(centre[None])), 0.0, atol=1e-12)


@given(SEEDS)
def test_slope_is_that_of_the_rows(rng: np.random.Generator) -> None:
    model = model_of(relief(rng, POINTS), ORTHOGRAPHIC, MODES)
    bending = Bending(model.coarse_edges(), np.ones(MODES)).about(0.05 * rng.normal(size=(3, MODES)))
    Lambda = 0.1 * rng.normal(size=(2, 3, MODES))
    step = np.zeros((2, 3, MODES))
    step[:, 2] = rng.normal(size=(2, MODES))
    h = 1e-5
    change = (bending.completed(Lambda + h * step) - bending.completed(Lambda - h * step)) / (2 * h)
    found = (bending.slope(Lambda) @ step[:, 2, :, None]).reshape(2, 3, MODES)
    np.testing.assert_allclose(found, change, atol=1e-6)


@pytest.mark.parametrize("vertices", [8, 60, 500])
def test_edges_of_any_number_of_vertices_will_do(vertices: int) -> None:
    model = model_of(flat(np.random.default_rng(0), POINTS), ORTHOGRAPHIC, MODES)
    edges = model.coarse_edges(vertices)
    bent = np.zeros((1, 3, MODES))
    bent[0, 2, 0] = 0.2
    drawn = Bending(edges, np.ones(MODES)).completed(bent)
    assert np.isfinite(drawn).all()
    assert strained(edges, drawn) < strained(edges, bent)
