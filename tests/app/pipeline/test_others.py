"""After cuts to and fro: what was followed before is recognised, and goes on on its own mesh."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.commands.retexture import retexture
from app.options.model import Model
from app.options.retexture import Retexture
from app.playback.playback import Playback
from app.terminal.progress import Progress
from tests.app.command_line import in_own_process, turning
from tests.app.scenes import GOOD, RED, another, run, scenes
from tests.synthetic_run import verify

A, B = 30, 110  # frames
AGAIN = 60


@pytest.fixture(autouse=True)
def in_folder(here: Path) -> None:
    """Recordings go to a folder of their own."""


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the results of a run over a sheet, another one, and the first again; and its words on the terminal."""
    folder = tmp_path_factory.mktemp("there_and_back")
    video = scenes(folder / "aba.mp4", turning(A), another(B), turning(AGAIN))
    files = ("--tracks-out", "tracks.npz", "--shapes-out", "shapes.npz")
    done = in_own_process(folder, "run", video, "--out", "film.rrd", "--json", *files, *GOOD)
    assert done.code == 0, done.err
    (folder / "out.json").write_text(done.out)
    (folder / "err.txt").write_text(done.err)
    return folder


def test_an_earlier_object_goes_on_on_its_mesh(film: Path) -> None:
    words = json.loads((film / "out.json").read_text())
    assert (words["objects"], words["losses"], words["recoveries"]) == (2, 2, 1)
    assert (words["parts"], words["own_parts"]) == (3, ["film.rrd", "film-part3.rrd"])
    first, other, again = (Playback.load(film / name) for name in ("film.rrd", "film-part2.rrd", "film-part3.rrd"))
    assert A + B <= again.frames[0] <= A + B + 5
    assert [*first.frames, *other.frames, *again.frames] == list(range(A + B + AGAIN))
    assert again.shaped.all()
    np.testing.assert_array_equal(again.mesh.faces, first.mesh.faces)
    np.testing.assert_array_equal(again.texture_px, first.texture_px)
    np.testing.assert_allclose(again.basis.rest, first.basis.rest)
    assert again.summary is not None
    assert again.summary["own_parts"] == words["own_parts"]
    for playback in (other, again):
        assert [said for _, _, _, said in playback.events if "an earlier object is back" in said]
    verify(again.path)
    with np.load(film / "shapes.npz") as shapes, np.load(film / "tracks.npz") as tracks:
        assert shapes["frames"].tolist() == [*first.frames, *again.frames]
        assert len(tracks["W"]) == len(shapes["frames"])
        assert np.isfinite(shapes["S"][-AGAIN + 5 :]).all()


@pytest.mark.slow
def test_its_picture_is_painted_on_it_again(film: Path) -> None:
    cv2.imwrite("red.png", RED)
    model = Model(modes=5, bootstrap_frames=20)
    command = Retexture(
        source=str(film / "aba.mp4"),
        texture=Path("red.png"),
        out=Path("o.mp4"),
        points=100,
        rest_shape="plane",
        model=model,
    )
    painted = retexture(command, Progress())
    assert A + AGAIN - 5 <= painted.painted_frames <= A + AGAIN


@pytest.mark.slow
def test_only_so_many_are_kept(film: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.pipeline.others.MOST_KEPT", 0)
    for name in ("AFTER_CUT_S", "AFTER_COVER_S"):
        monkeypatch.setattr(f"app.pipeline.successor.{name}", 0.5)
    words = run(film / "aba.mp4")
    assert (words["objects"], words["recoveries"], words["own_parts"]) == (3, 0, ("run.rrd",))
