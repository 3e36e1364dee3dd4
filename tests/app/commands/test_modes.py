"""The figure of the mode shapes: drawn from recordings and tracks, and recorded with a run."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from app.commands.modes import modes
from app.options.export import Modes
from app.options.model import Model
from app.options.run import Output
from app.options.run import Run as Asked
from app.pipeline.session import Session
from app.recording import entities
from app.recording.modes_figure import AMPLITUDE, View, boundary, brightness, displaced, modes_figure, spectrum
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modes import ModalBasis, modal_basis
from tests.app.command_line import Command
from tests.synthetic_run import MODES, Run, write_run
from tracking.tracks import Tracks

POINTS, FRAMES = 40, 12


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return write_run(tmp_path_factory.mktemp("modes") / "sheet.rrd")


@pytest.fixture
def tracks(tmp_path: Path) -> Path:
    """A stiff bowl that turns, with its truth."""
    rng = np.random.default_rng(5)
    xy = rng.uniform(-80, 80, (2, POINTS))
    bowl = np.vstack([xy, (xy**2).sum(axis=0) / 150])
    angles = np.linspace(0, 0.8, FRAMES)
    turned = [np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]]) @ bowl for a in angles]
    S = np.stack(turned)
    W = S[:, :2] + 200
    visible = np.ones((FRAMES, POINTS), bool)
    path = tmp_path / "bowl.npz"
    Tracks(W, visible, S_gt=S, gt_frames=np.arange(FRAMES)).save(path)
    return path


def picture(content: bytes | Path) -> NDArray[np.uint8]:
    content = content.read_bytes() if isinstance(content, Path) else content
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return np.asarray(image, np.uint8)


def colorful(image: NDArray[np.uint8]) -> float:
    """Share of the pixels that are blue or red: the surfaces."""
    pixels = image.astype(int)
    return float(np.mean(np.ptp(pixels, axis=2) > 40))


def test_a_recording_shows_its_own_modes(tmp_path: Path, run: Run) -> None:
    out = tmp_path / "modes.png"
    drawn = modes(Modes(run.path, out=out), Progress())
    assert drawn.modes == MODES
    assert drawn.eigenvalues == pytest.approx(run.basis.eigenvalues)
    assert 0.5 < drawn.share < 1
    image = picture(out)
    assert image.shape[1] > image.shape[0] > 600
    assert 0.05 < colorful(image) < 0.6


def test_tracks_show_the_modes_of_their_rest_shape(tmp_path: Path, tracks: Path) -> None:
    truth = Tracks.load(tracks).S_gt
    assert truth is not None
    found = {}
    for kind in ("first-truth", "rigid"):
        command = Modes(tracks, out=tmp_path / f"{kind}.png", rest_shape=kind, model=Model(modes=6))
        found[kind] = modes(command, Progress()).eigenvalues
    expected = modal_basis(truth[0], triangulate(truth[0, :2].T), 6, "jensen-shannon").eigenvalues
    assert found["first-truth"] == pytest.approx(expected)
    assert found["rigid"] == pytest.approx(expected, rel=0.02)


def test_the_metric_matters(tmp_path: Path, tracks: Path) -> None:
    eigenvalues = []
    for metric in ("euclidean", "manhattan"):
        command = Modes(
            tracks,
            out=tmp_path / f"{metric}.png",
            rest_shape="first-truth",
            model=Model(modes=5, metric=metric),  # type: ignore[arg-type]
        )
        drawn = modes(command, Progress())
        assert drawn.metric == metric
        eigenvalues.append(drawn.eigenvalues)
    assert eigenvalues[0] != pytest.approx(eigenvalues[1], rel=0.01)


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
    from app.recording.modes_figure import PANEL_INCHES, limits

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


def test_a_run_records_the_figure(tmp_path: Path, shared_data: Path) -> None:
    out, paper = tmp_path / "paper.rrd", shared_data / "kinect_paper.mp4"
    run = Asked(str(paper), roi=(195, 95, 325, 265), frames="0:12", points=150, output=Output(out=out))
    Session(run, Progress()).run()
    [chunk] = [chunk for chunk in RrdReader(out).stream() if chunk.entity_path.strip("/") == entities.MODES]
    batch = chunk.to_record_batch()
    blob = batch.column(batch.schema.names.index("EncodedImage:blob"))[0].as_py()[0]
    assert 0.05 < colorful(picture(bytes(blob))) < 0.6


def test_the_command_line(modeshape: Command, tmp_path: Path, run: Run) -> None:
    done = modeshape("modes", run.path, "--out", tmp_path / "modes.png", "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["points"] == run.basis.rest.shape[1]
    assert (tmp_path / "modes.png").is_file()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["absent.rrd"], "absent.rrd"),
        (["notes.txt"], "notes.txt"),
        (["foreign.npz"], "foreign.npz"),
        (["early.rrd"], "no model"),
        (["bowl.npz", "--modes", "40"], "--modes 40"),
        (["bowl.npz", "--rest-shape", "absent.obj"], "absent.obj"),
        (["bowl.npz", "--columns", "0"], "--columns 0"),
        (["bowl.npz", "--out", "modes.xyz"], "modes.xyz"),
        (["bowl.npz", "--out", "notes.png"], "--overwrite"),
    ],
)
def test_mistakes_are_told_in_one_line(
    modeshape: Command, tmp_path: Path, tracks: Path, words: list[str], complaint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert tracks.parent == tmp_path
    monkeypatch.chdir(tmp_path)
    for name in ("notes.txt", "notes.png"):
        Path(name).write_text("no recording")
    np.savez("foreign.npz", x=np.zeros(3))
    write_run(Path("early.rrd"), frames=3, first_shape=9)
    done = modeshape("modes", *words)
    assert (done.code, done.out) == (2, ""), done.err
    last = done.err.strip().splitlines()[-1]
    assert last.startswith("error: ")
    assert complaint in last
    assert not Path("modes.png").exists()


def test_only_png(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"let it end in \.png"):
        Modes(tmp_path / "x.rrd", out=Path("modes.pdf"))
