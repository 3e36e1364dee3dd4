import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from app.painting.raster import Rasteriser, SurfaceMap, sides_of_edges
from reconstruction.basis.mesh import triangulate

SIZE = (160, 120)
GRID = np.stack(np.meshgrid(np.linspace(30.3, 120.6, 12), np.linspace(20.2, 95.7, 10)), axis=-1).reshape(-1, 2)


def whole(surface: SurfaceMap) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The map over the whole picture: places and cover."""
    uv, cover = np.zeros((*SIZE[::-1], 2), np.float32), np.zeros(SIZE[::-1], np.float32)
    uv[surface.region], cover[surface.region] = surface.uv, surface.cover
    return uv, cover


def mapped(reference: NDArray[np.float64], points: NDArray[np.float64], depth: NDArray[np.float64]) -> SurfaceMap:
    faces = triangulate(reference).faces
    surface = Rasteriser(faces, reference, SIZE, perspective=True).map(points, depth)
    assert surface is not None
    return surface


@given(st.integers(0, 10_000))
def test_at_rest_every_pixel_shows_itself_and_none_is_missed(seed: int) -> None:
    points = GRID + np.random.default_rng(seed).uniform(-3, 3, GRID.shape)
    uv, cover = whole(mapped(points, points, np.full(len(points), 500.0)))
    y, x = np.nonzero(cover == 1)
    assert np.abs(uv[y, x] - np.column_stack([x, y])).max() < 1e-3
    inner = np.zeros_like(cover, bool)
    inner[26:90, 36:115] = True
    assert (cover[inner] == 1).all()


@given(st.floats(-0.3, 0.3), st.floats(0.6, 1.05), st.floats(-4, 4))
def test_area_at_the_edge_is_shared_out_to_the_pixels(turn: float, scale: float, shift: float) -> None:
    c, s = scale * np.cos(turn), scale * np.sin(turn)
    middle = GRID.mean(axis=0)
    points = (GRID - middle) @ np.array([(c, s), (-s, c)]) + middle + shift
    _, cover = whole(mapped(GRID, points, np.ones(len(points))))
    low, high = GRID.min(axis=0), GRID.max(axis=0)
    true = float(np.prod(high - low)) * scale**2
    outline = 2 * scale * float((high - low).sum())
    assert abs(cover.sum() - true) < 0.02 * outline  # whole pixels only would be off by up to half of it
    assert ((cover > 0) & (cover < 1)).sum() > 0.3 * outline


def test_edges_are_not_jagged() -> None:
    corners = np.array([(20.0, 20.0), (130.0, 27.3), (126.0, 90.0), (24.0, 84.0)])
    _, cover = whole(mapped(corners, corners, np.ones(4)))
    top = cover[18:40].sum(axis=0)[30:120]  # where the edge is, column by column
    line = np.polyfit(np.arange(len(top)), top, 1)
    assert np.abs(top - np.polyval(line, np.arange(len(top)))).max() < 0.15


@pytest.mark.parametrize("tilt", [0.3, 0.8])
def test_perspective_is_exact_inside_large_triangles(tilt: float) -> None:
    corners = np.array([(-50.0, -40.0), (50, -40), (50, 40), (-50, 40)])
    depth = 200 + tilt * corners[:, 0]
    points = corners / depth[:, None] * 200 + 70
    surface = Rasteriser(np.array([(0, 1, 2), (0, 2, 3)]), corners + 70, SIZE, perspective=True).map(points, depth)
    assert surface is not None
    uv, cover = whole(surface)
    y, x = np.nonzero(cover == 1)
    across, down = (x - 70) / 200, (y - 70) / 200
    deep = 200 / (1 - tilt * across)
    assert np.abs(uv[y, x] - np.column_stack([across * deep + 70, down * deep + 70])).max() < 0.1


@pytest.mark.parametrize("near", ["left", "right"])
@pytest.mark.parametrize("perspective", [True, False])
def test_the_nearer_of_two_layers_is_seen(near: str, perspective: bool) -> None:
    left, right = GRID * (0.5, 1), GRID * (0.5, 1) + (75, 0)
    faces = triangulate(GRID).faces
    reference = np.concatenate([left, right])
    points = np.concatenate([right, right])  # the left half slid before or behind the right one
    depth = np.repeat([400.0, 500.0] if near == "left" else [500.0, 400.0], len(GRID))
    both = np.concatenate([faces, faces + len(GRID)])
    surface = Rasteriser(both, reference, SIZE, perspective=perspective).map(points, depth)
    assert surface is not None
    seen = surface.uv[surface.cover == 1][:, 0]
    assert (seen < 70).all() if near == "left" else (seen > 80).all()


def test_the_back_is_not_painted_but_hides() -> None:
    fold = 75.0
    points = GRID.copy()
    over = points[:, 0] > fold
    points[over, 0] = 2 * fold - points[over, 0]  # the right part is turned over, onto the left one
    depth = np.where(over, 400.0, 500.0)
    uv, cover = whole(mapped(GRID, points, depth))
    assert (cover[30:88, 36:66] == 0).all()  # the back of the right part hides the left one
    _, cover = whole(mapped(GRID, points, np.where(over, 600.0, 500.0)))
    assert (cover[30:88, 36:66] == 1).all()  # it is behind now
    assert uv.max() < 121


def test_a_turned_sliver_makes_no_hole() -> None:
    points = GRID + np.random.default_rng(0).uniform(-1, 1, GRID.shape)
    mesh = triangulate(GRID)
    middle = int(np.linalg.norm(GRID - GRID.mean(axis=0), axis=1).argmin())
    points[middle] += (9.5, 0)  # past its neighbour: two of its triangles turn over
    surface = Rasteriser(mesh.faces, GRID, SIZE, perspective=False).map(points, np.ones(len(GRID)))
    assert surface is not None
    _, cover = whole(surface)
    assert (cover[30:88, 40:110] == 1).all()


@pytest.mark.parametrize(
    ("points", "depth"),
    [
        (GRID + 500, np.ones(len(GRID))),
        (GRID - 500, np.ones(len(GRID))),
        (GRID, -np.ones(len(GRID))),
        (GRID * np.nan, np.ones(len(GRID))),
    ],
    ids=["right", "left", "behind the camera", "lost"],
)
def test_what_is_not_in_view_has_no_map(points: NDArray[np.float64], depth: NDArray[np.float64]) -> None:
    assert Rasteriser(triangulate(GRID).faces, GRID, SIZE, perspective=True).map(points, depth) is None


def test_a_surface_half_out_of_the_picture_is_cut_off() -> None:
    _, cover = whole(mapped(GRID, GRID + np.array((80, 60)), np.ones(len(GRID))))
    assert (cover[82:, 112:] == 1).all()
    assert (cover[:78] == 0).all()


def test_every_edge_knows_its_faces() -> None:
    faces = triangulate(GRID).faces
    edges, sides = sides_of_edges(faces)
    assert len(edges) == len(np.unique(edges, axis=0))
    assert (sides[:, 0] >= 0).all()
    for (a, b), owners in zip(edges, sides, strict=True):
        for owner in owners[owners >= 0]:
            assert {a, b} <= set(faces[owner])
    assert (sides >= 0).sum() == 3 * len(faces)
