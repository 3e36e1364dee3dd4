"""The report of the paper's experiments: what is computed, written, brought up to date, and left out."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.commands.reproduce import reproduce
from app.options.reproduce import NAMES, README_BEGIN, README_END, Reproduce
from app.reproduce.catalog import CATALOG
from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiments.missing import breaking_point
from app.reproduce.experiments.organ import POINTS, REST_FRAMES, organ, organ_tracks
from app.reproduce.lines import FACE, FLAG
from app.reproduce.part import Part
from app.reproduce.report import Report, processor, replaced_between
from app.reproduce.result import Headline, Result, Table, markdown_table
from app.reproduce.work import Effort, Work
from app.terminal.errors import UsageError
from reconstruction.evaluation import e3d
from tests.app.terminal import Command


def test_every_experiment_can_be_asked_for() -> None:
    assert tuple(experiment.name for experiment in CATALOG) == NAMES
    for experiment in CATALOG:
        assert experiment.expected_s(Effort(quick=True)) <= experiment.expected_s(Effort())


def test_the_organ_rests_then_beats_and_stretches() -> None:
    surface = organ()
    assert surface.rest.shape == (3, POINTS)
    np.testing.assert_allclose(surface.beating(REST_FRAMES), surface.rest)
    beating = np.stack([surface.beating(f) for f in range(REST_FRAMES, REST_FRAMES + 24)])
    changes = np.linalg.norm(beating - surface.rest, axis=(1, 2)) / np.linalg.norm(surface.rest)
    assert 0.05 < changes.max() < 0.3
    a, b = np.random.default_rng(0).integers(POINTS, size=(2, 50))
    lengths = np.linalg.norm(beating[:, :, a] - beating[:, :, b], axis=1)
    assert (np.ptp(lengths, axis=0) > 0.03 * lengths[0]).mean() > 0.9


def test_the_organ_is_seen_with_little_noise() -> None:
    tracks = organ_tracks(20, 80)
    assert tracks.K is not None
    assert tracks.S_gt is not None
    image = tracks.K @ tracks.S_gt
    assert (tracks.W - image[:, :2] / image[:, 2:]).std() == pytest.approx(0.3, rel=0.1)
    assert e3d(np.broadcast_to(tracks.S_gt[0], (REST_FRAMES, 3, 80)), tracks.S_gt[:REST_FRAMES]).max() < 1e-9


@pytest.mark.parametrize(
    ("errors", "static", "expected"),
    [
        ([[2.0], [3.0], [3.9]], 6.0, "not up to 80%"),
        ([[2.0], [3.0], [4.1]], 6.0, "80%"),
        ([[2.0, 2.0], [2.9, 3.3], [3.0, 3.1]], 3.0, "40%"),
        ([[2.0, 2.0], [2.1, None], [3.0, 3.1]], 6.0, "40%"),
        ([[None], [2.0], [2.0]], 6.0, "0%"),
    ],
)
def test_a_line_breaks_where_it_is_of_no_more_use(errors: list[list[float | None]], static: float, expected: str) -> None:
    assert breaking_point((0.0, 0.4, 0.8), errors, static) == expected


def test_lines_are_commands() -> None:
    config = FACE.config(Path("data"), modes=5, noise=0.01, seed=2, metric="manhattan")
    assert config.tracks == Path("data/face37.npz")
    assert (config.model.modes, config.model.metric, config.model.deformation) == (5, "manhattan", "general")
    assert (config.noise, config.seed, config.missing) == (0.01, 2, 0.0)
    assert FLAG.config(Path("data")) == FLAG.config(Path("data"), missing=0.0)


def test_a_trial_is_computed_once_and_fails_in_words(tmp_path: Path) -> None:
    organ_tracks(6, 40).save(tmp_path / FLAG.file)
    with Work(tmp_path, tmp_path, Effort(quick=True), 1.0) as work, work.experiment("trial", 1.0, 3):
        config = FLAG.config(tmp_path, modes=5, deformation="general")
        first = work.evaluated(config)
        assert first["e3d"] is not None
        assert work.evaluated(config) is first
        failed = work.evaluated(FLAG.config(tmp_path, modes=40))
    assert failed["e3d"] is None
    assert "--modes 40" in failed.failure


def test_a_part_is_silent_and_counts(capfd: pytest.CaptureFixture[str]) -> None:
    advanced = []
    with Part(lambda: advanced.append(1)) as part:
        part.expect(3)
        part.say("hello")
        part.at(1, 3)
        part.advance("tracking")
    assert advanced == [1]
    assert capfd.readouterr() == ("", "")


def test_cells_of_tables() -> None:
    text = markdown_table(["what", "number"], [["a|b", 1.234], ["c", None], ["d", 7]])
    assert text.splitlines() == ["| what | number |", "| --- | ---: |", "| a\\|b | 1.23 |", "| c | – |", "| d | 7 |"]


def test_charts_have_gaps_bands_and_levels() -> None:
    series = [
        Series("seeds", [1, 2, 3], [[1.0, 2.0], [None, 2.0], [2.0, 3.0]]),
        Series("one", [1, 2, 3], [1.0, None, 2.0], 1),
    ]
    panels = [
        Panel("p", "x", "y", series, levels=(("level", 1.5),), points=(("point", 2, 1.0),)),
        Panel("q", "x", "y", series, logarithmic=True),
    ]
    image = cv2.imdecode(np.frombuffer(charts(panels), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    assert image.shape[1] > 2.5 * image.shape[0]
    assert (np.ptp(image.astype(int), axis=2) > 60).mean() > 0.002


def test_the_readme_keeps_all_but_the_table() -> None:
    text = f"before\n{README_BEGIN}\nold\n{README_END}\nafter\n"
    assert (
        replaced_between(text, README_BEGIN, README_END, "new\n") == f"before\n{README_BEGIN}\nnew\n{README_END}\nafter\n"
    )
    assert replaced_between("nothing", README_BEGIN, README_END, "new\n") is None
    assert replaced_between(f"{README_END} {README_BEGIN}", README_BEGIN, README_END, "new\n") is None


def test_our_readme_has_a_place_for_the_table() -> None:
    readme = (Path(__file__).parents[3] / "README.md").read_text()
    assert replaced_between(readme, README_BEGIN, README_END, "") is not None


def test_the_processor_is_named_where_known() -> None:
    assert processor(lambda: "vendor_id : X\nmodel name\t: Fast Chip 3\n") == "Fast Chip 3"

    def unreadable() -> str:
        raise OSError

    assert processor(unreadable)


def result(name: str) -> Result:
    headline = Headline("data", "setting", 1.234, None, "others")
    return Result(
        [Table("t", ("a", "b"), [("x", 1.0)])], {f"{name}.png": b"png"}, {f"{name}.jpg": b"jpg"}, ["Seen."], [headline]
    )


def test_a_report_is_brought_up_to_date(tmp_path: Path) -> None:
    names = [experiment.name for experiment in CATALOG]
    Report(tmp_path, names).add(CATALOG[1], result("second"), 1.0, quick=False)
    Report(tmp_path, names).add(CATALOG[0], result("first"), 1.0, quick=True)
    report = Report(tmp_path, names)
    assert list(report.as_words()["experiments"]) == names[:2]
    report.add(CATALOG[1], result("again"), 1.0, quick=False)
    text = (tmp_path / "report.md").read_text()
    assert text.index(CATALOG[0].title) < text.index(CATALOG[1].title)
    assert "quick run" in text
    assert "(figures/again.png)" in text
    assert "`footage/again.jpg`" in text
    assert "(footage/" not in text  # such pictures are not shown where the report is published
    assert not (tmp_path / "figures" / "second.png").exists()
    assert (tmp_path / "footage" / ".gitignore").read_text().splitlines()[-1] == "*"
    assert report.headlines().count("| data | setting | 1.23 | – | others |") == 2


def test_other_folders_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(UsageError, match="holds other files"):
        Report(tmp_path, [])
    (tmp_path / "report.json").write_text("[1, 2]")
    with pytest.raises(UsageError, match="no report of this program"):
        Report(tmp_path, [])


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
    readme.write_text(f"# Title\n{README_BEGIN}\n{README_END}\nend\n")
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
def test_real_data_give_every_table(shared_data: Path, tmp_path: Path) -> None:
    words = reproduce(
        Reproduce(shared_data, tmp_path / "out", only=("accuracy", "mode-counts", "metrics", "missing"), quick=True)
    )
    experiments = words["experiments"]
    assert isinstance(experiments, dict)
    [table, published] = experiments["accuracy"]["tables"]
    assert published["rows"][0][1] == 2.92
    for row in table["rows"]:
        line = dict(zip(table["columns"], row, strict=True))
        assert line["e3d %"] < line["rest shape alone"]
        assert line["e3d %"] <= line["camera"] + 1e-9
    [table] = experiments["metrics"]["tables"]
    assert {row[-1] for row in table["rows"]} <= set(table["columns"][1:-1])
    assert experiments["missing"]["tables"][0]["rows"][0][-1].startswith("not up to")
    assert [len(row) for row in experiments["mode-counts"]["tables"][0]["rows"]] == [5] * 8


def test_real_data_stand_beside_peers(shared_data: Path, tmp_path: Path) -> None:
    words = reproduce(Reproduce(shared_data, tmp_path / "out", only=("peers", "mode-shapes"), quick=True))
    experiments = words["experiments"]
    assert isinstance(experiments, dict)
    rows = {row[0]: row for row in experiments["peers"]["tables"][0]["rows"]}
    assert rows["PND2"][1] == 6.47
    assert rows["ours, on-line"][1] < rows["PND2"][1]
    assert (tmp_path / "out" / "footage" / "modes-flag250.jpg").stat().st_size > 10_000


def test_a_video_becomes_a_strip_and_a_chart(shared_data: Path, tmp_path: Path) -> None:
    words = reproduce(Reproduce(shared_data, tmp_path / "out", only=("paper",), quick=True))
    experiments = words["experiments"]
    assert isinstance(experiments, dict)
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
