"""The figure of the mode shapes and their spectrum."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.figures.modes_figure import modes_figure, spectrum
from app.recording.modes import AMPLITUDE, View, brightness, displaced
from reconstruction.basis.mesh import boundary
from reconstruction.basis.modal_basis import ModalBasis
from reconstruction.basis.modes import modal_basis
from tests.synthetic_run import MODES, Run

POINTS, FRAMES = 40, 12


def picture(content: bytes | Path) -> NDArray[np.uint8]:
    content = content.read_bytes() if isinstance(content, Path) else content
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image, np.uint8)


@pytest.mark.parametrize("metric", ["euclidean", "manhattan"])
def test_the_spectrum_begins_with_the_modes(run: Run, metric: str) -> None:
    basis = modal_basis(run.basis.rest, run.mesh, MODES, metric)  # type: ignore[arg-type]
    values = spectrum(basis, run.mesh, metric)
    assert len(values) == run.basis.rest.shape[1]
    assert (np.diff(values) <= 1e-9 * values[0]).all()
    assert values[:MODES] == pytest.approx(basis.eigenvalues)


def test_of_many_points_the_spectrum_is_that_of_the_modes(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("reconstruction.basis.modes.EXACT_POINTS", len(run.pixels) - 1)
    np.testing.assert_array_equal(spectrum(run.basis, run.mesh, "euclidean"), run.basis.eigenvalues)


@pytest.mark.parametrize(("count", "columns"), [(1, 5), (3, 2), (12, 12)])
def test_any_number_of_modes(run: Run, count: int, columns: int) -> None:
    basis = modal_basis(run.basis.rest, run.mesh, count)
    drawn = modes_figure(basis, run.mesh, spectrum(basis, run.mesh, "euclidean"), title="sheet", columns=columns)
    wider = picture(drawn).shape[1]
    assert wider == pytest.approx(150 * (1.25 + 4.1) + min(count, columns) * panel_px(basis, columns), rel=0.02)


def panel_px(basis: ModalBasis, columns: int) -> float:
    from app.figures.modes_figure import PANEL_INCHES, limits

    length = float(np.ptp(basis.Phi[:, 0] @ basis.rest))
    x, y = limits(basis, View.three_quarter(), length, min(columns, len(basis.eigenvalues)))
    return float(150 * PANEL_INCHES * np.sqrt(np.ptp(x) / np.ptp(y)))


def test_modes_move_along_their_axis_by_a_fixed_share_of_the_length(run: Run) -> None:
    for axis in range(3):
        moved = displaced(run.basis, axis, 2, 100.0) - run.basis.rest
        along = run.basis.Phi[:, axis] @ moved
        assert np.abs(along).max() == pytest.approx(AMPLITUDE * 100)
        assert np.linalg.norm(moved, axis=0) == pytest.approx(np.abs(along), abs=1e-9)


def test_the_view_is_a_rotation_and_light_is_bounded(run: Run) -> None:
    view = View.three_quarter()
    assert view.axes @ view.axes.T == pytest.approx(np.eye(3))
    assert np.linalg.det(view.axes) == pytest.approx(1)
    bent = displaced(run.basis, 2, 2, float(np.ptp(run.basis.rest)))
    light = brightness(bent, run.mesh.faces, view)
    assert light.min() >= 0.4
    assert light.max() <= 1.0
    assert np.ptp(light) > 0.1
    assert brightness(bent, run.mesh.faces[:, ::-1], view) == pytest.approx(light)


def test_the_rim_is_a_closed_line(run: Run) -> None:
    rim = boundary(run.mesh.faces)
    assert (np.bincount(rim.ravel())[np.unique(rim)] == 2).all()
