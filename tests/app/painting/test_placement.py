import numpy as np
import pytest
from numpy.typing import NDArray

from app.painting.placement import Placement, corners_of, extent, in_first_frame, upright
from app.painting.surface import Surface
from reconstruction.basis.mesh import triangulate

SIZE = (320, 240)
SHEET = np.array(((40.0, 60.0), (250.0, 40.0), (270.0, 200.0), (50.0, 180.0)))
TURN = np.array(((np.cos(0.2), -np.sin(0.2)), (np.sin(0.2), np.cos(0.2))))


def within(quad: NDArray[np.float64], margin: float, count: int = 14) -> NDArray[np.float64]:
    """Points (n, 2) of a grid in a figure of four corners, off its border by a share of its size."""
    u, v = np.meshgrid(np.linspace(margin, 1 - margin, count), np.linspace(margin, 1 - margin, count))
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1).reshape(-1, 4)
    return np.asarray(weights @ quad)


@pytest.mark.parametrize("start", range(4))
@pytest.mark.parametrize("way", [1, -1])
def test_corners_told_in_any_order_are_upright(start: int, way: int) -> None:
    assert np.array_equal(upright(np.roll(SHEET, start, axis=0)[::way]), SHEET)


def test_the_axes_are_the_sheet_s_and_not_the_image_s() -> None:
    points = within(SHEET, 0.1)
    reach = extent(None, points, triangulate(points).faces, SIZE)
    assert reach.region is None
    assert np.abs(reach.quad - within(SHEET, 0.1, 2)[[0, 1, 3, 2]]).max() < 1.5
    told = extent(SHEET[::-1], points, triangulate(points).faces, SIZE)
    assert np.array_equal(told.quad, SHEET)


def test_what_has_no_four_sides_lies_in_a_rectangle() -> None:
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    points = np.concatenate([(150, 120) + r * np.column_stack([np.cos(angle), np.sin(angle)]) for r in (20, 50, 80)])
    reach = extent(None, points, triangulate(points).faces, SIZE)
    assert np.abs(reach.quad - ((69.5, 39.5), (230.5, 39.5), (230.5, 200.5), (69.5, 200.5))).max() <= 1
    assert reach.region is not None
    assert 0.9 < (reach.region > 0).sum() / (np.pi * 80**2) < 1.1


def test_an_outline_of_something_else_is_not_taken() -> None:
    points = within(SHEET, 0.1)
    reach = extent(SHEET - (0, 150), points, triangulate(points).faces, SIZE)
    assert np.abs(reach.quad - SHEET).max() < 40


def seen(points_mm: NDArray[np.float64], tilt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places px (n, 2) and depths (n,) of points (n, 3) before a camera, turned about an upright axis."""
    turn = np.array(((np.cos(tilt), 0, -np.sin(tilt)), (0, 1, 0), (np.sin(tilt), 0, np.cos(tilt))))
    x, y, z = (points_mm @ turn.T + (10.0, 5.0, 500.0)).T
    return np.column_stack([400 * x / z + 160, 400 * y / z + 120]), z


def bent(points_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    return points_mm + np.column_stack([np.zeros((len(points_mm), 2)), 0.002 * points_mm[:, 0] ** 2])


FLAT = np.array(((-100.0, -70, 0), (100, -70, 0), (100, 70, 0), (-100, 70, 0)))


@pytest.mark.parametrize("deformed", [False, True])
def test_the_net_goes_on_to_the_corners(deformed: bool) -> None:
    points_mm, corners = within(FLAT, 0.15), seen(FLAT, 0.3)[0]
    points = seen(points_mm, 0.3)[0]
    surface = Surface(points, triangulate(points), corners, None)
    moved, depth = seen(bent(points_mm) if deformed else points_mm, -0.4)
    nodes, depths = surface.nodes(moved, depth, moved, perspective=True)
    ends = [int(np.argmin(np.linalg.norm(surface.net.nodes_px - corner, axis=1))) for corner in corners]
    wanted, far = seen(bent(FLAT) if deformed else FLAT, -0.4)
    assert np.abs(nodes[ends] - wanted).max() < (3.0 if deformed else 0.2)
    assert np.abs(depths[ends] / far - 1).max() < 0.02


def test_a_place_told_in_another_frame_is_found_in_the_first() -> None:
    points = within(SHEET, 0.1)
    mesh = triangulate(points)
    depth = np.full(len(points), 400.0)
    told = np.array(((100.0, 90.0), (200.0, 90.0), (200.0, 150.0), (100.0, 150.0)))
    later = points @ TURN.T + (5, 3)
    placement = Placement(told @ TURN.T + (5, 3), outline=SHEET)
    found = in_first_frame(placement, (later, depth, later), points, mesh, SIZE, perspective=True)
    assert found.corners is not None
    assert np.abs(found.corners - told).max() < 0.5


def test_a_box_has_the_outer_borders_of_its_pixels() -> None:
    box = corners_of((10, 20, 30, 40))
    assert box is not None
    assert box.tolist() == [[9.5, 19.5], [39.5, 19.5], [39.5, 59.5], [9.5, 59.5]]
    four = corners_of((1.0, 2.0, 9.0, 2.0, 9.0, 7.0, 1.0, 7.0))
    assert four is not None
    assert four.tolist() == [[1, 2], [9, 2], [9, 7], [1, 7]]
