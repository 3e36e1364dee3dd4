"""Keyframes of a sheet seen without perspective, each in the likeliest of the shapes that fit it."""

from dataclasses import replace

import numpy as np

from reconstruction.camera import lens
from reconstruction.mapping.isometric.adjustment import bundled, sheet
from reconstruction.mapping.isometric.likeliest import likeliest, most_alike_first
from reconstruction.mapping.maps import LONG_LENS
from tests.reconstruction.mapping.bending import waving_sheet


def alike(shape: np.ndarray, true: np.ndarray) -> float:
    """Correlation of the depths of two shapes (3, p), or of one and the other's mirror image."""
    return float(abs(np.corrcoef(shape[2], true[2])[0, 1]))


def test_a_part_that_is_mirrored_is_found() -> None:
    _, S = waving_sheet(np.random.default_rng(5), frames=16)
    W = 200 * S[:, :2]
    found = bundled(sheet(W, np.ones((len(W), W.shape[2]), bool), lens(W, LONG_LENS)), W)
    B, c = found.values[found.nodes.points], found.coefficients.copy()
    depths = c[3] @ B.T - (c[3] @ B.T).mean()
    c[3] = np.abs(depths) @ np.linalg.pinv(B).T  # as deep as it is, but all one way
    wrong = replace(found, coefficients=c)
    assert alike(wrong.shapes()[3], S[3]) < 0.6
    assert alike(likeliest(wrong).shapes()[3], S[3]) > 0.97


def test_each_comes_after_what_it_looks_like() -> None:
    images = np.array([[0.0], [5.0], [1.0], [4.0], [2.5]])
    assert most_alike_first(images, 3).tolist() == [3, 1, 4, 2, 0]
