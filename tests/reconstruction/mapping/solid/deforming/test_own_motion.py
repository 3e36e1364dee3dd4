"""What does not move together is far apart, however near it lies; gaps and noise do not matter."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from reconstruction.arrays import Array
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modes import modal_basis
from reconstruction.mapping.solid.deforming.own_motion import TOGETHER, own_motion
from tests.reconstruction.world import relief

K, P = 40, 120


def parted(missing: float = 0.0, noise: float = 0.0) -> tuple[Array, Array, Array, Array]:
    """A relief, what is left over where its right half moves by itself, what is seen of it, and that half."""
    rng = np.random.default_rng(2)
    rest = relief(rng, P)
    other = rest[0] > 0
    course = 20 * rng.normal(size=(K, 2, 1))
    left_over = np.where(other, course, 0.0) + noise * rng.normal(size=(K, 2, P))
    return rest, left_over, rng.random((K, P)) >= missing, other


@pytest.mark.parametrize(("missing", "noise"), [(0.0, 0.0), (0.4, 0.5), (0.8, 0.5)])
def test_parts_are_as_far_apart_as_they_move_apart(missing: float, noise: float) -> None:
    _, left_over, visible, other = parted(missing, noise)
    places = own_motion(np.where(visible[:, None], left_over, np.nan), visible).T
    between, within = cdist(places[other], places[~other]), cdist(places[other], places[other])
    moved = TOGETHER * np.sqrt((left_over[:, :, other] ** 2).sum(axis=1).mean())
    assert np.median(between) == pytest.approx(moved, rel=0.15)
    assert np.median(within) < 0.25 * np.median(between)


def test_modes_do_not_take_along_what_only_lies_beside() -> None:
    rest, left_over, visible, other = parted()
    mesh, wanted = triangulate(rest[:2].T), other - other.mean()
    left = []
    for apart in (None, own_motion(left_over, visible)):
        modes = modal_basis(rest, mesh, 10, "jensen-shannon", apart).Upsilon
        left.append(np.linalg.norm(wanted - wanted @ modes.T @ modes))
    assert left[1] < 0.3 * left[0]


def test_without_any_motion_modes_are_those_of_the_shape() -> None:
    rest, left_over, visible, _ = parted()
    mesh = triangulate(rest[:2].T)
    apart = own_motion(np.zeros_like(left_over), visible)
    alone, same = (modal_basis(rest, mesh, 10, "jensen-shannon", one).Upsilon for one in (None, apart))
    np.testing.assert_allclose(same, alone, atol=1e-9)
