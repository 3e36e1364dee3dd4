"""Modal analysis is that of an elastic shell."""

import numpy as np
import pytest

from app.rivals.modal_analysis import shell, vibration_modes
from app.rivals.problems import surface_with_mesh


def test_a_shell_resists_everything_but_shifts() -> None:
    rest, mesh = surface_with_mesh(60)
    K, M = shell(rest, mesh.faces)
    assert abs(K - K.T).max() < 1e-12
    assert np.linalg.eigvalsh(K.toarray()).min() > -1e-9
    shift = np.tile([1.0, 2.0, -3.0], 60)
    assert np.abs(K @ shift).max() < 1e-10
    a, b, c = (rest.T[mesh.faces[:, k]] for k in range(3))
    assert M.diagonal().sum() / 3 == pytest.approx(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_a_flat_plate_bends_first() -> None:
    rest, mesh = surface_with_mesh(100)
    rest[2] = 0.0
    values, shapes = vibration_modes(rest, mesh.faces, 5)
    assert (values > 0).all()
    assert (np.diff(values) >= 0).all()
    across, within = np.abs(shapes[:, 2]).max(axis=1), np.abs(shapes[:, :2]).max(axis=(1, 2))
    assert (within < 1e-6 * across).sum() >= 4
