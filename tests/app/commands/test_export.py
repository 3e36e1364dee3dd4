"""Exports: opened again by other libraries, and equal to what the run had."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from app import demo
from app.commands.export import default_path, export, held
from app.options.export import Export
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from tests.app.command_line import Command
from tests.app.exported import FRAMES, exported, relative
from tests.app.glb_file import GlbFile, issues
from tests.synthetic_run import SIZE, Run, write_run

FORMATS = ("glb", "obj", "ply", "csv", "npz", "mp4", "webm")


@pytest.mark.parametrize("which", ["run", "orthographic"])
def test_glb_moves_as_the_shapes_and_is_valid(tmp_path: Path, which: str, request: pytest.FixtureRequest) -> None:
    run: Run = request.getfixturevalue(which)
    path = exported(run.path, "glb", tmp_path)
    file = GlbFile(path)
    assert file.times_s == pytest.approx(np.arange(FRAMES) / 30, abs=1e-6)
    assert np.array_equal(file.faces, run.mesh.faces)
    for time_s, estimate in zip(file.times_s, run.estimates, strict=True):
        assert relative(file.vertices(time_s), estimate.shape.T) < 1e-4
    assert issues(path) == []


def test_glb_camera_sees_the_vertices_where_the_video_has_them(tmp_path: Path, run: Run) -> None:
    gltf = (file := GlbFile(exported(run.path, "glb", tmp_path))).gltf
    vertices = file.vertices(file.times_s[3])  # under the root; the camera node looks along z from its origin
    focal_px = SIZE[1] / 2 / np.tan(gltf.cameras[0].perspective.yfov / 2)
    seen = vertices[:, :2] / vertices[:, 2:] * focal_px + run.camera.center_px
    assert np.abs(seen - run.estimates[3].projection_px).max() < 1e-2
    assert gltf.cameras[0].perspective.aspectRatio == pytest.approx(SIZE[0] / SIZE[1])


def test_glb_texture_has_the_video_s_colors_at_the_vertices(tmp_path: Path, run: Run) -> None:
    file = GlbFile(exported(run.path, "glb", tmp_path))
    image = cv2.imdecode(np.frombuffer(file.image(), np.uint8), cv2.IMREAD_COLOR)
    places = file.uv * image.shape[1::-1] - 0.5
    x, y = np.rint(places).astype(int).T
    px, py = np.rint(run.pixels).astype(int).T
    inside = np.abs(run.pixels - [80, 60]).min(axis=1) > 6  # away from the border between two colors
    assert np.abs(image[y, x].astype(int) - run.picture[py, px])[inside].max() < 25


def test_gaps_hold_the_last_value_and_the_start_the_first() -> None:
    values = np.array([np.nan, np.nan, 1, 2, np.nan, np.nan, 5])
    assert held(values).tolist() == [1, 1, 1, 2, 2, 2, 5]
    assert held(np.column_stack([values, values]))[:, 1].tolist() == [1, 1, 1, 2, 2, 2, 5]


def test_a_video_is_not_named_like_its_source() -> None:
    names = {kind: default_path(Path("here/sheet.rrd"), kind).as_posix() for kind in FORMATS}
    assert names["mp4"] == "here/sheet-overlay.mp4"
    assert names["glb"] == "here/sheet.glb"
    assert names["obj"] == "here/sheet_obj"
    assert len(set(names.values())) == len(FORMATS)


@pytest.mark.parametrize("kind", FORMATS)
def test_nothing_is_replaced_unasked(tmp_path: Path, run: Run, kind: str) -> None:
    path = exported(run.path, kind, tmp_path)
    with pytest.raises(UsageError, match=r"exists.*--overwrite"):
        exported(run.path, kind, tmp_path)
    foreign = path / "notes.txt" if path.is_dir() else tmp_path / "notes.txt"
    foreign.write_text("mine")
    if kind in ("obj", "ply"):
        (path / f"frame_000099.{kind}").write_text("of a longer recording")
    exported(run.path, kind, tmp_path, overwrite=True)
    assert foreign.read_text() == "mine"
    assert not (path / f"frame_000099.{kind}").exists()


@pytest.mark.parametrize("kind", FORMATS)
def test_a_recording_without_a_model_is_refused(tmp_path: Path, bootstrapping: Path, kind: str) -> None:
    with pytest.raises(UsageError, match="contains no model"):
        exported(bootstrapping, kind, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_video_needs_pictures(tmp_path: Path) -> None:
    run = write_run(tmp_path / "blind.rrd", image="none")
    with pytest.raises(UsageError, match="no pictures"):
        exported(run.path, "mp4", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["blind.rrd"]


@pytest.mark.parametrize("kind", ["obj", "glb", "npz", "csv"])
def test_a_full_disk_leaves_nothing(tmp_path: Path, run: Run, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    monkeypatch.setattr("app.playback.tables.table", full)
    monkeypatch.setattr("app.files.mesh_sequence.MeshSequence.add", full)
    monkeypatch.setattr("app.files.scenes.gltf.glb", full)
    with pytest.raises(UsageError, match="No space left"):
        exported(run.path, kind, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_place_of_a_folder(tmp_path: Path, run: Run) -> None:
    (tmp_path / "out_obj").write_text("")
    with pytest.raises(UsageError, match="is a file"):
        exported(run.path, "obj", tmp_path, overwrite=True)


@pytest.mark.parametrize("kind", ["glb", "obj"])
def test_an_unwritable_folder(tmp_path: Path, run: Run, kind: str) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot write"):
        export(Export(run.path, format=kind, out=tmp_path / "file" / f"x.{kind}"), Progress())  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({}, "no format"),
        ({"out": Path("x.gltf")}, "no format"),
        ({"format": "glb", "out": Path("x.gltf")}, "let it end in .glb"),
        ({"format": "mp4", "out": Path("x.webm")}, "let it end in .mp4"),
    ],
)
def test_formats_that_do_not_fit(options: dict[str, object], complaint: str) -> None:
    with pytest.raises(UsageError, match=complaint):
        Export(Path("sheet.rrd"), **options)  # type: ignore[arg-type]


def test_the_ending_tells_the_format() -> None:
    assert Export(Path("sheet.rrd"), out=Path("x.NPZ")).kind == "npz"
    assert Export(Path("sheet.rrd"), format="obj", out=Path("x.y")).kind == "obj"


def test_the_command_line(modeshape: Command, tmp_path: Path, run: Run) -> None:
    recording = shutil.copy(run.path, tmp_path)
    done = modeshape("export", recording, "--format", "glb", "--json")
    assert done.code == 0, done.err
    words = json.loads(done.out)
    assert (words["out"], words["points"]) == (str(tmp_path / "sheet.glb"), len(run.pixels))
    assert (tmp_path / "sheet.glb").is_file()


@pytest.mark.parametrize(
    ("video", "roi"),
    [
        pytest.param("kinect_paper.mp4", (195, 95, 325, 265), id="paper", marks=pytest.mark.slow),
        pytest.param("talking_face.mp4", (115, 70, 130, 160), id="face", marks=pytest.mark.slow),
        pytest.param(None, None, id="demo"),
    ],
)
def test_a_real_run_agrees_with_its_own_shapes(
    modeshape: Command, tmp_path: Path, request: pytest.FixtureRequest, video: str | None, roi: tuple[int, ...] | None
) -> None:
    recording, shapes = tmp_path / "real.rrd", tmp_path / "shapes.npz"
    source = demo.sample().video if video is None else request.getfixturevalue("shared_data") / video
    options = ("--roi", *map(str, roi or demo.sample().roi), "--frames", "0:30", "--points", "200")
    done = modeshape("run", source, *options, "--out", recording, "--shapes-out", shapes)
    assert done.code == 0, done.err
    with np.load(shapes) as stored:
        truth = dict(stored)
    with np.load(words_out(recording, "npz")) as stored:
        assert set(truth) <= set(stored)
        for key, values in truth.items():
            # The strain of a vertex of no face is NaN.
            assert stored[key] == pytest.approx(values, rel=1e-4, abs=1e-6, nan_ok=True), key
        in_a_face = np.unique(stored["faces"])  # trimesh leaves out a textured vertex of no face
    glb = GlbFile(words_out(recording, "glb"))
    sequence = sorted(words_out(recording, "ply").glob("frame_*.ply"))
    for time_s, path, S in zip(glb.times_s, sequence, truth["S"], strict=True):
        assert relative(glb.vertices(time_s), S.T) < 1e-4
        assert relative(np.asarray(trimesh.load_mesh(path, process=False).vertices), S.T[in_a_face]) < 1e-4
    assert issues(words_out(recording, "glb", overwrite=True)) == []


def words_out(recording: Path, kind: str, **options: object) -> Path:
    written = export(Export(recording, format=kind, **options), Progress())  # type: ignore[arg-type]
    return written.out


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["sheet.rrd", "--format", "fbx"], "fbx"),
        (["notes.txt", "--format", "glb"], "notes.txt"),
        (["absent.rrd", "--format", "glb"], "absent.rrd"),
        (["sheet.rrd"], "--format"),
    ],
)
def test_mistakes_are_told_in_one_line(
    modeshape: Command, tmp_path: Path, run: Run, words: list[str], complaint: str
) -> None:
    (tmp_path / "notes.txt").write_text("no recording")
    shutil.copy(run.path, tmp_path / "sheet.rrd")
    done = modeshape("export", tmp_path / words[0], *words[1:])
    assert (done.code, done.out) == (2, "")
    assert done.err.startswith("error: ")
    assert done.err.count("\n") == 1
    assert complaint in done.err
