"""The figure of the mode shapes: drawn from recordings and tracks, and recorded with a run."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from rerun.chunk import RrdReader

from app.commands.modes import modes
from app.files.track_file import load_tracks
from app.options.model import Model
from app.options.modes import Modes
from app.options.run import Output
from app.options.run import Run as Asked
from app.pipeline.session import Session
from app.recording import entities
from app.recording.modes import SHOWN
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from reconstruction.basis.mesh import triangulate
from reconstruction.basis.modes import modal_basis
from tests.app.command_line import Command
from tests.synthetic_run import MODES, Run, write_run
from tracking.tracks import Tracks

POINTS, FRAMES = 40, 12


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
    with path.open("wb") as file:
        Tracks(W, visible, S_gt=S, gt_frames=np.arange(FRAMES)).save(file)
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
    truth = load_tracks(tracks).S_gt
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


def test_a_run_records_its_modes(tmp_path: Path, shared_data: Path) -> None:
    out, paper = tmp_path / "paper.rrd", shared_data / "kinect_paper.mp4"
    run = Asked(str(paper), roi=(195, 95, 325, 265), frames="0:12", points=150, output=Output(out=out))
    Session(run, Progress()).run()
    meshes = [chunk.entity_path for chunk in RrdReader(out).stream() if f"/{entities.MODES}/" in chunk.entity_path]
    assert set(meshes) == {f"/{entities.MODES}/{name}" for name in ("names", *range(1, SHOWN + 1))}


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


def test_the_metric_of_a_recording_is_what_its_run_took(tmp_path: Path, shared_data: Path) -> None:
    """A bent sheet's modes are chi-squared, though its rest shape is not flat."""
    out, paper = tmp_path / "paper.rrd", shared_data / "kinect_paper.mp4"
    summary = Session(
        Asked(str(paper), roi=(195, 95, 325, 265), frames="0:70", points=150, output=Output(out=out)), Progress()
    ).run()
    assert summary.metric == "chi-squared"
    drawn = modes(Modes(out, out=tmp_path / "modes.png"), Progress())
    assert drawn.metric == "chi-squared"
    assert 0.5 < drawn.share <= 1
