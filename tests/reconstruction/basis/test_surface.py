"""Strain and curvature against shapes whose own are known."""

import numpy as np
import pytest

from reconstruction.basis.mesh import triangulate
from reconstruction.basis.surface import Surface

PLACES = np.random.default_rng(0).uniform(-1, 1, (600, 2))
FLAT = np.column_stack([PLACES, np.zeros(600)]).T
INNER = (np.abs(PLACES) < 0.8).all(axis=1)
SURFACE = Surface(FLAT, triangulate(PLACES).faces)
TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]


def cylinder(radius: float) -> np.ndarray:
    """The plane rolled up without stretching, its ridge to the camera."""
    x, y = PLACES.T
    return np.stack([radius * np.sin(x / radius), y, radius * (1 - np.cos(x / radius))])


def test_stretch() -> None:
    stretched = TURN @ (np.array([[1.1], [0.95], [1.0]]) * FLAT)
    assert SURFACE.strain(stretched) == pytest.approx(0.1)
    assert SURFACE.strain(FLAT) == pytest.approx(0.0, abs=1e-12)


def test_bending_is_no_stretch() -> None:
    assert np.abs(SURFACE.strain(cylinder(1.0))[INNER]).max() < 0.01


@pytest.mark.parametrize("radius", [0.8, 3.0])
def test_curvature_of_a_cylinder_and_a_ball(radius: float) -> None:
    found = SURFACE.curvature(cylinder(radius) + np.array([[0.0], [0.0], [9.0]]))
    assert np.median(found[INNER]) == pytest.approx(1 / (2 * radius), rel=0.05)
    assert np.median(SURFACE.curvature(cylinder(radius) * [[1], [1], [-1]])[INNER]) == pytest.approx(
        -1 / (2 * radius), rel=0.05
    )
    height = 2 * radius - np.sqrt((2 * radius) ** 2 - (PLACES**2).sum(axis=1))
    ball = Surface(FLAT, triangulate(PLACES).faces).curvature(np.column_stack([PLACES, height]).T)
    assert np.median(ball[INNER]) == pytest.approx(1 / (2 * radius), rel=0.1)


def test_a_plane_is_not_curved() -> None:
    assert np.abs(SURFACE.curvature(TURN @ FLAT)).max() < 1e-6
