"""`modeshape reproduce`: what is computed, skipped and written."""

import json
from pathlib import Path

import cv2
import pytest

from app.commands.reproduce import reproduce
from app.options.reproduce import Reproduce
from app.terminal.progress import Progress
from tests.app.command_line import Command


@pytest.mark.parametrize("readme", ["absent.md", "plain.md"])
def test_mistakes_are_told_before_anything_is_computed(here: Path, modeshape: Command, readme: str) -> None:
    Path("data").mkdir()
    Path("plain.md").write_text("no markers")
    outcome = modeshape("reproduce", "--data", "data", "--out", "out", "--readme", readme)
    assert outcome.code == 2
    assert f"--readme {readme}" in outcome.err
    assert not (here / "out").exists()


def test_no_data_no_report(here: Path, modeshape: Command) -> None:
    assert modeshape("reproduce", "--data", "absent", "--out", "out").code == 2
    Path("data").mkdir()
    outcome = modeshape("reproduce", "--data", "data", "--out", "out", "--only", "peers", "missing")
    assert outcome.code == 2
    assert "flag250.npz" in outcome.err
    assert not list((here / "out").glob("report*"))


def test_what_has_no_data_is_skipped(here: Path, modeshape: Command) -> None:
    Path("data").mkdir()
    readme = here / "README.md"
    readme.write_text("# Title\n<!-- reproduce: begin -->\n<!-- reproduce: end -->\nend\n")
    outcome = modeshape(
        *("reproduce", "--data", "data", "--out", "out", "--quick", "--only", "organ", "basis-time", "peers"),
        *("--readme", readme, "--json"),
    )
    assert outcome.code == 0, outcome.err
    assert "peers: skipped, data has no flag250.npz, face37.npz" in outcome.err
    words = json.loads(outcome.out)
    assert list(words["experiments"]) == ["basis-time", "organ"]
    assert words["skipped"] == {"peers": ["flag250.npz", "face37.npz"]}
    stored = json.loads((here / "out" / "report.json").read_text())
    assert stored["experiments"] == words["experiments"]
    row = dict(zip(*(lambda t: (t["columns"], t["rows"][0]))(words["experiments"]["organ"]["tables"][0]), strict=True))
    assert row["e3d %"] < row["rest shape alone"]
    for name in ("organ.png", "organ-error.png", "basis-time.png"):
        assert cv2.imread(str(here / "out" / "figures" / name)) is not None
    assert "| synthetic beating organ | general, r = 10, D_M, 300 points |" in readme.read_text()
    assert readme.read_text().startswith("# Title")


@pytest.mark.slow
def test_real_data_give_the_first_table(shared_data: Path, tmp_path: Path) -> None:
    reproduced = reproduce(Reproduce(shared_data, tmp_path / "out", only=("accuracy",), quick=True), Progress())
    [table, published] = reproduced.experiments["accuracy"]["tables"]
    assert published["rows"][0][1] == 2.92
    for row in table["rows"]:
        line = dict(zip(table["columns"], row, strict=True))
        assert line["e3d %"] < line["rest shape alone"]
        assert line["e3d %"] <= line["camera"] + 1e-9


@pytest.mark.slow
def test_real_data_give_every_table(shared_data: Path, tmp_path: Path) -> None:
    asked = Reproduce(shared_data, tmp_path / "out", only=("mode-counts", "metrics", "missing"), quick=True)
    experiments = reproduce(asked, Progress()).experiments
    [table] = experiments["metrics"]["tables"]
    assert {row[-1] for row in table["rows"]} <= set(table["columns"][1:-1])
    assert experiments["missing"]["tables"][0]["rows"][0][-1].startswith("not up to")
    assert [len(row) for row in experiments["mode-counts"]["tables"][0]["rows"]] == [5] * 8


@pytest.mark.slow
def test_hard_cases_are_taken_for_what_they_are(tmp_path: Path) -> None:
    reproduced = reproduce(Reproduce(tmp_path, tmp_path / "out", only=("hard-cases",), quick=True), Progress())
    [table] = reproduced.experiments["hard-cases"]["tables"]
    sheet, solid = (dict(zip(table["columns"], row, strict=True)) for row in table["rows"])
    assert (sheet["what"], sheet["taken for"]) == ("waving-5", "sheet")
    assert (solid["what"], solid["taken for"]) == ("box-late", "solid")
    assert sheet["at the end"] < 1.1
    assert solid["at the end"] < 0.4 < 2 < solid["first frames alone"]


def test_real_data_stand_beside_peers(shared_data: Path, tmp_path: Path) -> None:
    reproduced = reproduce(Reproduce(shared_data, tmp_path / "out", only=("peers", "mode-shapes"), quick=True), Progress())
    experiments = reproduced.experiments
    rows = {row[0]: row for row in experiments["peers"]["tables"][0]["rows"]}
    assert rows["PND2"][1] == 6.47
    assert rows["ours, on-line"][1] < rows["PND2"][1]
    assert (tmp_path / "out" / "footage" / "modes-flag250.jpg").stat().st_size > 10_000


@pytest.mark.slow
def test_a_video_becomes_a_strip_and_a_chart(shared_data: Path, tmp_path: Path) -> None:
    reproduced = reproduce(Reproduce(shared_data, tmp_path / "out", only=("paper",), quick=True), Progress())
    experiments = reproduced.experiments
    [table] = experiments["paper"]["tables"]
    assert [row[0] for row in table["rows"]] == ["528", "not given"]
    strip = cv2.imread(str(tmp_path / "out" / "footage" / "kinect_paper.jpg"))
    assert strip is not None
    assert strip.shape[:2] == (720, 1440)
    assert cv2.imread(str(tmp_path / "out" / "figures" / "kinect_paper-error.png")) is not None


def test_interrupted_keeps_what_is_done(here: Path, modeshape: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(_rest: object, *_more: object) -> None:
        raise KeyboardInterrupt

    Path("data").mkdir()
    monkeypatch.setattr("app.reproduce.experiments.organ_run.organ_tracks", interrupted)
    outcome = modeshape("reproduce", "--data", "data", "--out", "out", "--quick", "--only", "basis-time", "organ", "--json")
    assert outcome.code == 130
    words = json.loads(outcome.out)
    assert words["interrupted"] is True
    assert list(words["experiments"]) == ["basis-time"]
    assert (here / "out" / "report.md").is_file()
