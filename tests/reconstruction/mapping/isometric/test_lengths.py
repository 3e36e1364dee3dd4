"""Log lengths along rays: derivatives, scale, and that the adjustment goes down to a minimum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.mapping.isometric.images.smooth_field import smooth_field
from reconstruction.mapping.isometric.lengths import Edges, Solver, adjust_depths, cost, edges_of, finish_depths, gradient

SEEDS = st.integers(0, 10_000).map(np.random.default_rng)
F, M, R = 4, 25, 8


def some_edges(rng: np.random.Generator) -> tuple[Edges, np.ndarray, np.ndarray]:
    """Edges, stiffness, coefficients."""
    xy = rng.uniform(-0.4, 0.4, (2, M))
    field = smooth_field(xy, R)
    rays = np.concatenate([xy + 0.05 * rng.standard_normal((F, 2, M)), np.ones((F, 1, M))], axis=1)
    ends = np.unique(np.sort([rng.choice(M, 2, replace=False) for _ in range(70)], axis=1), axis=0)
    first, second = ends.T
    middles = (rays[:, :, first] + rays[:, :, second]) / 2
    B = np.stack([field.at(places) for places in (xy[:, first], (xy[:, first] + xy[:, second]) / 2, xy[:, second])])
    edges = edges_of(rays, middles, ends, B, rng.uniform(0.1, 1, (F, len(ends))))
    return edges, field.stiffness, 0.1 * rng.standard_normal((F, R))


def derivatives(edges: Edges, c: np.ndarray) -> np.ndarray:
    return edges.by_shares(edges.logs_and_shares(c)[1])


def cost_at(edges: Edges, c: np.ndarray, stiffness: np.ndarray, solver: Solver) -> float:
    return cost(edges, edges.log_lengths(c), c, stiffness, solver)


def gradient_at(edges: Edges, c: np.ndarray, stiffness: np.ndarray, solver: Solver) -> np.ndarray:
    return gradient(edges, edges.log_lengths(c), derivatives(edges, c), c, stiffness, solver)


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_derivatives_of_log_lengths_are_exact(rng: np.random.Generator) -> None:
    edges, _, c = some_edges(rng)
    step, d = 1e-6, rng.standard_normal(c.shape)
    numeric = (edges.log_lengths(c + step * d) - edges.log_lengths(c - step * d)) / (2 * step)
    np.testing.assert_allclose(np.einsum("frn,fr->fn", derivatives(edges, c), d), numeric, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("bend", [0.3, 0.6, 0.9])
def test_length_of_an_edge_is_that_of_the_bent_line_not_of_its_chord(bend: float) -> None:
    turns = np.array([-bend, 0.0, bend])  # on a cylinder of radius 1, its axis across, five away from the camera
    points = np.stack([np.sin(turns), np.zeros(3), 6 - np.cos(turns)])
    rays, depths = points / points[2], points[2]
    B = np.eye(3)[:, None]  # log depths themselves are the coefficients
    edges = edges_of(rays[None][:, :, [0, 2]], rays[None][:, :, 1:2], np.array([[0, 1]]), B, np.ones((1, 1)))
    length = float(np.exp(edges.log_lengths(np.log(depths)[None])[0, 0]))
    chord = 2 * np.sin(bend)
    assert abs(length - 2 * bend) < 0.05 * (2 * bend - chord)


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_gradient_is_half_the_derivative_of_the_cost(rng: np.random.Generator) -> None:
    edges, stiffness, c = some_edges(rng)
    solver, step, d = Solver(), 1e-6, rng.standard_normal(c.shape)
    numeric = cost_at(edges, c + step * d, stiffness, solver) - cost_at(edges, c - step * d, stiffness, solver)
    exact = 2 * float((gradient_at(edges, c, stiffness, solver) * d).sum())
    np.testing.assert_allclose(exact, numeric / (2 * step), rtol=1e-5, atol=1e-7)


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS, scale=st.floats(-3, 3))
def test_scale_of_all_depths_adds_to_every_log_length(rng: np.random.Generator, scale: float) -> None:
    edges, _, c = some_edges(rng)
    larger = c + scale * np.eye(R)[0]
    np.testing.assert_allclose(edges.log_lengths(larger), edges.log_lengths(c) + scale, atol=1e-9)


@settings(max_examples=5, deadline=None)
@given(rng=SEEDS)
def test_adjustment_ends_in_a_minimum_with_mean_depth_one(rng: np.random.Generator) -> None:
    edges, stiffness, c = some_edges(rng)
    solver = Solver(steps=200, enough=1e-12)
    found = adjust_depths(edges, c, stiffness, solver)
    assert cost_at(edges, found, stiffness, solver) < cost_at(edges, c - c.mean(axis=0) * np.eye(R)[0], stiffness, solver)
    slope = gradient_at(edges, found, stiffness, solver)
    slope[:, 0] -= slope[:, 0].mean()
    assert np.abs(slope).max() < 1e-3
    assert abs(found[:, 0].mean()) < 1e-9


@settings(max_examples=5, deadline=None)
@given(rng=SEEDS)
def test_known_lengths_bring_a_frame_back(rng: np.random.Generator) -> None:
    edges, stiffness, c = some_edges(rng)
    one = edges.frames(slice(0, 1))
    logs = one.log_lengths(c[:1])[0]
    found = finish_depths(one, logs, c[:1] + 0.01 * rng.standard_normal((1, R)), stiffness, 0.0, steps=30)[0]
    np.testing.assert_allclose(one.log_lengths(found)[0], logs, atol=1e-4)
