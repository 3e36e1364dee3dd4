"""What a recording holds, read back with Rerun."""

import json
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from app.recording.recording import entities
from reconstruction.basis.surface import Surface
from reconstruction.camera import Camera
from tests.app.recording.rows import Rows, frame, read, record
from tests.synthetic_run import MODES, SIZE, STAGE_MS, Run, verify, write_run
from tracking.observation import Observation
from tracking.video import Frame


def test_rerun_accepts_the_file(run: Run) -> None:
    verify(run.path)


def test_timelines_are_frame_and_time(rows: Rows) -> None:
    assert list(rows[entities.OBSERVATION, "modeshape.Observation:phase"]) == list(range(6))
    times = rows[entities.OBSERVATION, entities.TIME]
    assert times == {index: pytest.approx(index / 30 * 1e9, abs=1) for index in range(6)}
    assert not any(name in ("log_time", "log_tick") for _, name in rows)


def test_estimates_come_back_exactly(run: Run, rows: Rows) -> None:
    for index, estimate in enumerate(run.estimates):
        for name, value in (
            ("quaternion", estimate.quaternion),
            ("t", estimate.t),
            ("s", [estimate.s]),
            ("Lambda", estimate.Lambda.ravel()),
            ("visible", estimate.visible),
            ("sigma", estimate.sigma),
        ):
            np.testing.assert_array_equal(rows[entities.ESTIMATE, f"modeshape.Estimate:{name}"][index], value)
        vertices = np.array(rows[entities.MESH, "Mesh3D:vertex_positions"][index])
        np.testing.assert_allclose(vertices, estimate.shape.T, rtol=1e-6, atol=1e-5)


def test_what_is_unsure_is_red(run: Run, rows: Rows, tmp_path: Path) -> None:
    colors = np.array(rows[entities.MESH, "Mesh3D:vertex_colors"][0], np.uint32)
    red, green, blue = ((colors >> shift) & 255 for shift in (24, 16, 8))
    assert (red == 255).all()
    assert green[0] == blue[0] == 255
    assert (np.diff(green.astype(int)) <= 0).all()
    assert green[-1] < 64
    path = tmp_path / "sure.rrd"
    with record(path) as recording:
        recording.observe(Frame(0, 0.0, run.picture), run.observations[0], phase="tracking")
        recording.rest(run.basis, run.mesh, run.camera, run.picture, run.pixels)
        recording.estimate(0, 0.0, replace(run.estimates[0], sigma=None))
    sure = read(path)
    assert not any(name == "modeshape.Estimate:sigma" for _, name in sure)
    depth = np.array(sure[entities.MESH, "Mesh3D:vertex_colors"][0], np.uint32)
    nearest, farthest = run.estimates[0].shape[2].argsort()[[0, -1]]
    assert depth[nearest] >> 8 & 255 > depth[nearest] >> 24  # bluer than red
    assert depth[farthest] >> 8 & 255 < depth[farthest] >> 24


@pytest.mark.parametrize("by", ["strain", "curvature"])
def test_what_is_longer_or_bulges_is_red_if_that_is_asked_for(by: str, tmp_path: Path) -> None:
    run = write_run(tmp_path / "run.rrd", color=by)
    colors = np.array(read(run.path)[entities.MESH, "Mesh3D:vertex_colors"][5], np.uint32)
    values = getattr(Surface(run.basis.rest, run.mesh.faces), by)(run.estimates[5].shape)
    redder = (colors >> 24).astype(int) - (colors >> 8 & 255).astype(int)
    assert redder[values.argmax()] > 50
    assert np.corrcoef(redder, values)[0, 1] > 0.9


def test_observations_come_back(run: Run, rows: Rows) -> None:
    for index, observation in enumerate(run.observations):
        visible = np.array(rows[entities.OBSERVATION, "modeshape.Observation:visible"][index])
        np.testing.assert_array_equal(visible, observation.visible)
        seen = np.full((len(visible), 2), np.nan)
        seen[visible] = rows[entities.SEEN, "Points2D:positions"][index]
        np.testing.assert_allclose(seen, observation.points_px, rtol=1e-6)
    phases = rows[entities.OBSERVATION, "modeshape.Observation:phase"]
    assert [phase for [phase] in phases.values()] == ["bootstrap"] * 2 + ["tracking"] * 4


def test_reprojected_mesh_is_found_by_its_strips(run: Run, rows: Rows) -> None:
    strips = np.array(rows[f"{entities.MODEL}/0", "modeshape.Model:strips"][None])
    for index, estimate in enumerate(run.estimates):
        drawn = np.concatenate(rows[entities.WIREFRAME, "LineStrips2D:strips"][index])
        np.testing.assert_allclose(drawn, estimate.projection_px[strips[strips >= 0]], rtol=1e-6)


def test_the_model_is_complete(run: Run, rows: Rows) -> None:
    for name, value in (
        ("rest", run.basis.rest.ravel()),
        ("Upsilon", run.basis.Upsilon.ravel()),
        ("eigenvalues", run.basis.eigenvalues),
        ("Phi", run.basis.Phi.ravel()),
        ("faces", run.mesh.faces.ravel()),
        ("edges", run.mesh.edges.ravel()),
        ("texture_px", run.pixels.ravel()),
        ("size", SIZE),
        ("perspective", [True]),
        ("focal_px", [200.0]),
        ("center_px", [80.0, 60.0]),
    ):
        np.testing.assert_array_equal(rows[f"{entities.MODEL}/0", f"modeshape.Model:{name}"][None], value)


def test_the_texture_is_the_first_frame(run: Run, rows: Rows) -> None:
    [layout] = rows[entities.MESH, "Mesh3D:albedo_texture_format"][None]
    [buffer] = rows[entities.MESH, "Mesh3D:albedo_texture_buffer"][None]
    image = np.array(buffer, np.uint8).reshape(layout["height"], layout["width"], 3)
    uv = np.array(rows[entities.MESH, "Mesh3D:vertex_texcoords"][None])
    texels = np.floor(uv * [layout["width"], layout["height"]]).astype(int)
    pixels = np.floor(run.pixels + 0.5).astype(int)
    np.testing.assert_array_equal(image[texels[:, 1], texels[:, 0], ::-1], run.picture[pixels[:, 1], pixels[:, 0]])


def test_points_are_lost_until_a_shape_predicts_them(run: Run, rows: Rows, tmp_path: Path) -> None:
    hidden = ~run.estimates[1].visible
    predicted = rows[entities.PREDICTED, "Points2D:positions"][1]
    np.testing.assert_allclose(predicted, run.estimates[1].projection_px[hidden], rtol=1e-6)
    assert rows[entities.LOST, "Points2D:positions"][1] == []

    shapeless = read(write_run(tmp_path / "shapeless.rrd", frames=2, first_shape=9).path)
    lost = shapeless[entities.LOST, "Points2D:positions"][1]
    np.testing.assert_allclose(lost, run.observations[0].points_px[hidden], rtol=1e-6)


def test_until_there_is_a_shape_the_view_says_what_is_waited_for(rows: Rows, tmp_path: Path) -> None:
    assert rows[entities.STATUS, "Points3D:labels"][1] == []
    shapeless = read(write_run(tmp_path / "shapeless.rrd", frames=2, first_shape=9).path)
    assert shapeless[entities.STATUS, "Points3D:labels"][1] == ["watching the first frames: 2/60"]


def test_a_lost_surface_leaves_no_mesh_on_the_picture(tmp_path: Path) -> None:
    path = tmp_path / "lost.rrd"
    run = write_run(path, frames=3, first_shape=0)
    with record(path, overwrite=True) as recording:
        recording.rest(run.basis, run.mesh, run.camera, run.picture, run.pixels)
        recording.observe(Frame(0, 0.0, run.picture), run.observations[0], phase="tracking")
        recording.estimate(0, 0.0, run.estimates[0])
        nothing = Observation(np.full_like(run.pixels, np.nan), np.zeros(len(run.pixels), bool))
        recording.observe(Frame(1, 1 / 30, run.picture), nothing, phase="lost")
    rows = read(path)
    assert rows[entities.WIREFRAME, "LineStrips2D:strips"][1] == []
    assert rows[entities.PREDICTED, "Points2D:positions"][1] == []
    assert len(rows[entities.LOST, "Points2D:positions"][1]) == len(run.pixels)


def test_the_outline_is_in_the_first_frame_only(tmp_path: Path) -> None:
    path, line = tmp_path / "outline.rrd", np.array([[10.0, 10.0], [50.0, 12.0], [30.0, 40.0], [10.0, 10.0]])
    with record(path) as recording:
        recording.region(0, 0.0, [line])
        for index in range(3):
            recording.observe(*frame(index), phase="bootstrap")
    strips = read(path)[entities.REGION, "LineStrips2D:strips"]
    np.testing.assert_array_equal(strips[0], [line])
    assert strips[1] == []


def test_curves(run: Run, rows: Rows) -> None:
    np.testing.assert_allclose(rows[entities.ERROR, "Scalars:scalars"][3], np.sqrt([0.5, 0.5]))
    np.testing.assert_allclose(rows[entities.VISIBLE, "Scalars:scalars"][1], [run.observations[1].visible.mean()])
    for stage, milliseconds in STAGE_MS.items():
        assert rows[f"{entities.TIMING}/{stage}", "Scalars:scalars"][4] == [milliseconds]
    assert len(rows[entities.LEADING, "Scalars:scalars"][3]) == 9
    assert rows[entities.EVENTS, "TextLog:text"] == {2: ["rest shape: plane"]}


def test_configuration_version_and_summary(rows: Rows) -> None:
    [configuration] = rows[entities.CONFIGURATION, "modeshape.Document:json"][None]
    [summary] = rows[entities.SUMMARY, "modeshape.Document:json"][None]
    assert json.loads(configuration) == {"source": "sheet.mp4", "modes": MODES}
    assert json.loads(summary) == {"frames": 6, "e3d": 0.03}
    assert rows[entities.CONFIGURATION, "modeshape.Document:version"][None] == [version("modeshape")]


def test_an_orthographic_camera_has_no_pinhole(tmp_path: Path) -> None:
    rows = read(write_run(tmp_path / "flat.rrd", camera=Camera(np.inf, np.array([80.0, 60.0]))).path)
    assert rows[f"{entities.MODEL}/0", "modeshape.Model:perspective"][None] == [False]
    assert not any(entity == entities.CAMERA for entity, _ in rows)


def test_a_file_with_a_final_pass_is_drawn_once(tmp_path: Path, run: Run) -> None:
    """What is drawn on the way would be there twice; without a final pass it is drawn at the end."""
    sizes = []
    for revised in (range(3), range(0)):
        path = tmp_path / f"{len(revised)}.rrd"
        with record(path, final_pass=True) as recording:
            recording.rest(run.basis, run.mesh, run.camera, run.picture, run.pixels)
            for index in range(3):
                recording.observe(Frame(index, index / 30, run.picture), run.observations[index], phase="tracking")
                recording.estimate(index, index / 30, run.estimates[0])
            for index in revised:
                recording.final_pass()
                recording.estimate(index, index / 30, run.estimates[index])
        rows = read(path)
        for index in range(3):
            shown = np.array(rows[entities.MESH, "Mesh3D:vertex_positions"][index])
            np.testing.assert_allclose(shown, run.estimates[index if revised else 0].shape.T, rtol=1e-6, atol=1e-5)
        sizes.append(sum(chunk.num_rows for chunk in RrdReader(path).stream() if chunk.entity_path == f"/{entities.MESH}"))
    assert sizes[0] == sizes[1]


def test_the_view_is_that_of_the_final_pass(tmp_path: Path, run: Run) -> None:
    """Shapes on the way may be anywhere else; they are not shown any more."""
    places = []
    for on_the_way in (1.0, 3.0):
        path = tmp_path / f"{on_the_way}.rrd"
        with record(path, final_pass=True) as recording:
            recording.rest(run.basis, run.mesh, run.camera, run.picture, run.pixels)
            for index in range(3):
                recording.observe(Frame(index, index / 30, run.picture), run.observations[index], phase="tracking")
                estimate = run.estimates[index]
                recording.estimate(index, index / 30, replace(estimate, shape=on_the_way * estimate.shape))
            recording.final_pass()
            for index in range(3):
                recording.estimate(index, index / 30, run.estimates[index])
        rows = read(path)
        places.append([rows[entities.MESH, f"Transform3D:{part}"][None] for part in ("translation", "scale")])
    assert places[0] == places[1]
