"""Lengths of edges on shapes of smooth functions, and a step towards them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.mapping.isometric.bundle import Lengths, stepped
from reconstruction.mapping.isometric.shape_prior import ShapePrior

SEEDS = st.integers(0, 10_000).map(np.random.default_rng)
F, R, N = 3, 8, 40


def some_lengths(rng: np.random.Generator) -> Lengths:
    return Lengths(rng.standard_normal((2, N, R)), np.zeros(N), np.ones(N), np.zeros(R))


@settings(max_examples=10, deadline=None)
@given(rng=SEEDS)
def test_slopes_of_logs_are_exact(rng: np.random.Generator) -> None:
    lengths, C = some_lengths(rng), rng.standard_normal((F, 3, R))
    step, d = 1e-6, rng.standard_normal(C.shape)
    numeric = (lengths.now(C + step * d)[0] - lengths.now(C - step * d)[0]) / (2 * step)
    exact = sum((slopes * (d @ half.T)).sum(axis=1) for slopes, half in zip(lengths.now(C)[1], lengths.halves, strict=True))
    np.testing.assert_allclose(exact, numeric, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("bend", [0.3, 0.6, 0.9])
def test_length_is_that_of_the_bent_line_not_of_its_chord(bend: float) -> None:
    turns = np.array([-bend, 0.0, bend])
    C = np.stack([np.sin(turns), np.zeros(3), np.cos(turns)])[None]  # functions that are 1 at one of three points
    first, middle, second = np.eye(3)
    lengths = Lengths(np.stack([middle - first, second - middle])[:, None], np.zeros(1), np.ones(1), np.zeros(3))
    assert abs(np.exp(lengths.now(C)[0][0, 0]) - 2 * bend) < 0.05 * (2 * bend - 2 * np.sin(bend))


def test_steps_without_data_end_where_edges_have_their_lengths() -> None:
    rng = np.random.default_rng(0)
    lengths, true = some_lengths(rng), rng.standard_normal((F, 3, R))
    lengths = Lengths(lengths.halves[:, :15], lengths.now(true)[0][0][:15], np.ones(15), lengths.stiffness)
    C = true[:1] + 0.05 * rng.standard_normal((1, 3, R))
    prior = ShapePrior(np.eye(3, R), np.eye(R), np.zeros((0, 3 * R)), np.full(3 * R, 1e-6), of_others=False)
    for _ in range(40):
        C = stepped(C, np.zeros((1, 3 * R, 3 * R)), lengths, prior)
    np.testing.assert_allclose(lengths.now(C)[0][0], lengths.logs, atol=1e-5)  # up to the weak pull to the mean


def test_free_lengths_are_the_mean_of_all_frames_and_couple_their_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reconstruction.mapping.isometric.bundle.DAMPING", 0.0)
    rng = np.random.default_rng(1)
    lengths, C, size = some_lengths(rng), rng.standard_normal((F, 3, R)), 3 * R
    lengths = replace(lengths, weights=rng.random(N))
    half = rng.standard_normal((F, size, size))
    data = half @ half.transpose(0, 2, 1)
    prior = ShapePrior(np.zeros((3, R)), np.eye(R), np.zeros((0, size)), np.full(size, 1e-9), of_others=False)
    logs, slopes = lengths.now(C)
    root = np.sqrt(lengths.weights) / lengths.give
    by_frame = np.einsum("hfcn,hnr->fcrn", slopes, lengths.halves).reshape(F, size, N) * root
    rows = np.zeros((F * size, F * N))  # of all frames' logs less their means, by all shapes
    for f in range(F):
        rows[f * size : (f + 1) * size] = np.concatenate([by_frame[f] * ((f == g) - 1 / F) for g in range(F)], axis=1)
    normal, left = rows @ rows.T, ((logs - logs.mean(axis=0)) * root).ravel()
    for f in range(F):
        normal[f * size : (f + 1) * size, f * size : (f + 1) * size] += data[f]
    gradient = np.concatenate([one @ c.ravel() for one, c in zip(data, C, strict=True)]) + rows @ left
    expected = C - np.linalg.solve(normal, gradient).reshape(C.shape)
    np.testing.assert_allclose(stepped(C, data, lengths, prior, free=True), expected, rtol=1e-5, atol=1e-6)
