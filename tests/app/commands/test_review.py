import csv
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pyarrow.csv  # type: ignore[import-untyped]
import pytest

from app.commands.cli import carry_out
from app.commands.review import review
from app.options.review import Review
from app.playback.measures import measures, reviewed
from app.playback.playback import Playback
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from reconstruction.camera import Camera
from tests.synthetic_run import write_run

FRAMES = 12
HIDDEN = 16  # of 48 points, in odd frames
ERROR_PX = np.sqrt(0.5)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("review") / "sheet.rrd", frames=FRAMES).path


@pytest.fixture(scope="module")
def without_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("review") / "early.rrd", frames=4, first_shape=9).path


@pytest.fixture(scope="module")
def orthographic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    camera = Camera(center_px=np.array([80.0, 60.0]))
    return write_run(tmp_path_factory.mktemp("review") / "flat.rrd", frames=5, camera=camera).path


def test_measures(path: Path) -> None:
    measured = measures(Playback.load(path))
    assert measured.rms_px == pytest.approx(np.full(FRAMES, ERROR_PX), abs=1e-4)
    assert measured.errors(95) == pytest.approx(np.full(FRAMES, ERROR_PX), abs=1e-4)
    assert measured.visible_share.tolist() == [1.0, 2 / 3] * (FRAMES // 2)
    assert measured.lost.tolist() == [0, HIDDEN] * (FRAMES // 2)
    assert measured.recovered.tolist() == [0, 0] + [HIDDEN, 0] * (FRAMES // 2 - 1)
    assert measured.total_ms.tolist() == [22.5] * FRAMES


def test_json(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carry_out(Review(path, json=True)) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["frames"] == facts["frames_with_shape"] == FRAMES
    assert facts["phases"] == [
        {"phase": "bootstrap", "first": 0, "last": 1},
        {"phase": "tracking", "first": 2, "last": FRAMES - 1},
    ]
    assert (facts["points"], facts["modes"]) == (48, 4)
    assert (facts["point_losses"], facts["point_recoveries"]) == (6 * HIDDEN, 5 * HIDDEN)
    assert facts["visible_share"] == pytest.approx({"mean": 5 / 6, "min": 2 / 3, "last": 2 / 3})
    assert facts["reprojection_px"] == pytest.approx(
        dict.fromkeys(("mean", "median", "p95", "max", "rms"), ERROR_PX), abs=1e-4
    )
    assert facts["stage_ms"]["track"] == {"mean": 12.5, "p95": 12.5, "max": 12.5}
    assert facts["stage_ms"]["total"]["mean"] == 22.5
    assert facts["e3d"] == 0.03
    assert facts["rest_shape_note"] == "rest shape: plane"
    assert facts["configuration"] == {"source": "sheet.mp4", "modes": 4}
    first, second = (worst["frame"] for worst in facts["worst_frames"][:2])
    assert abs(first - second) >= 5


def test_table(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    review(Review(path), Progress()).print_table()
    table = capsys.readouterr().out
    for words in ("12 (0 to 11, 0.37 s), 12 with a shape", "bootstrap 0–1, tracking 2–11", "mean 0.707", "83.3%", "3.00%"):
        assert words in table


def test_json_of_an_orthographic_run_is_json(orthographic: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carry_out(Review(orthographic, json=True)) == 0

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    json.loads(capsys.readouterr().out, parse_constant=refuse)


def test_csv(path: Path, tmp_path: Path) -> None:
    out = tmp_path / "frames.csv"
    review(Review(path, csv=out), Progress())
    table = pyarrow.csv.read_csv(out).to_pydict()
    assert table["frame"] == list(range(FRAMES))
    assert table["phase"] == ["bootstrap"] * 2 + ["tracking"] * (FRAMES - 2)
    assert table["error_rms_px"] == pytest.approx([ERROR_PX] * FRAMES, abs=1e-4)
    assert table["visible"] == [48, 32] * (FRAMES // 2)
    assert table["reconstruct_ms"] == [7.0] * FRAMES
    playback = Playback.load(path).estimates
    assert table["qy"] == pytest.approx(playback.quaternion[:, 2].tolist(), abs=1e-12)
    assert table["Lambda_tau_px"] == pytest.approx(np.linalg.norm(playback.Lambda[:, 2], axis=1).tolist(), rel=1e-12)
    with out.open(encoding="utf-8", newline="") as file:
        assert len(list(csv.DictReader(file))) == FRAMES


def test_csv_of_two_recordings_is_one_table(path: Path, without_model: Path, tmp_path: Path) -> None:
    out = tmp_path / "frames.csv"
    review(Review(path, without_model, csv=out, json=True), Progress())
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["recording"] for row in rows] == ["sheet"] * FRAMES + ["early"] * 4
    assert {row["error_rms_px"] for row in rows[FRAMES:]} == {""}


def test_comparison(path: Path, without_model: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert carry_out(Review(path, without_model, json=True)) == 0
    both = json.loads(capsys.readouterr().out)["recordings"]
    assert [facts["frames"] for facts in both] == [FRAMES, 4]
    assert both[1]["reprojection_px"] is None
    review(Review(path, without_model), Progress()).print_table()
    lines = [line for line in capsys.readouterr().out.splitlines() if "48, " in line]
    assert "48, lost 96 times" in lines[0]
    assert "48, lost 32 times" in lines[0]


def test_recordings_of_equal_name_are_told_apart(path: Path) -> None:
    playback = Playback.load(path)
    assert [one.label for one in reviewed([playback])] == ["sheet"]
    assert [one.label for one in reviewed([playback, playback])] == [str(path)] * 2


@pytest.mark.parametrize("kinds", ["full", "early", "full full", "full early", "early full", "flat full"])
def test_figures(path: Path, without_model: Path, orthographic: Path, tmp_path: Path, kinds: str) -> None:
    recordings = [{"full": path, "early": without_model, "flat": orthographic}[kind] for kind in kinds.split()]
    out = tmp_path / "figure.png"
    review(Review(*recordings, plot=out, json=True), Progress())
    picture = cv2.imread(str(out))
    assert picture is not None
    assert picture.shape[1] == 1600
    assert picture.mean() > 150  # on white
    assert picture.std() > 10  # and not empty


def test_heat_map_shows_the_coefficients(path: Path) -> None:
    from app.playback.plots import review_figure

    both = reviewed([Playback.load(path)])
    figure = review_figure(both)
    [tau] = [axes for axes in figure.axes if "tau" in axes.get_ylabel()]
    drawn = tau.collections[0].get_array()
    assert drawn is not None
    assert np.array_equal(np.asarray(drawn).reshape(4, FRAMES), both[0].playback.estimates.Lambda[:, 2].T)


@pytest.mark.parametrize(("suffix", "start"), [(".pdf", b"%PDF"), (".svg", b"<?xml"), (".PNG", b"\x89PNG")])
def test_formats(path: Path, tmp_path: Path, suffix: str, start: bytes) -> None:
    out = tmp_path / f"figure{suffix}"
    review(Review(path, plot=out, json=True), Progress())
    assert out.read_bytes().startswith(start)


def test_nothing_is_overwritten_unasked(path: Path, tmp_path: Path) -> None:
    for option in ("csv", "plot"):
        out = tmp_path / f"there.{'png' if option == 'plot' else 'csv'}"
        out.write_text("mine")
        ask: Callable[..., Review] = lambda out=out, option=option, **more: Review(path, json=True, **{option: out}, **more)  # noqa: E731
        with pytest.raises(UsageError, match=f"{out.name} exists: replace it with --overwrite"):
            review(ask(), Progress())
        assert out.read_text() == "mine"
        review(ask(overwrite=True), Progress())
        assert out.read_bytes() != b"mine"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["missing.rrd"], "error: there is no recording missing.rrd"),
        (["notes.rrd"], "error: notes.rrd is not a recording"),
        (["sheet.rrd", "--plot", "figure.bmp"], "error: --plot figure.bmp: .bmp is no format for figures"),
        (["sheet.rrd", "--connect", "127.0.0.1:1"], "error: no viewer answers at 127.0.0.1:1"),
        (["sheet.rrd", "missing.rrd"], "error: there is no recording missing.rrd"),
    ],
)
def test_errors_are_one_line(path: Path, tmp_path: Path, options: list[str], words: str) -> None:
    (tmp_path / "sheet.rrd").write_bytes(path.read_bytes())
    (tmp_path / "notes.rrd").write_text("dear diary")
    command = [Path(sys.executable).with_name("modeshape"), "review", *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert words in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert done.stdout == ""
    assert not list(tmp_path.glob("figure*"))
