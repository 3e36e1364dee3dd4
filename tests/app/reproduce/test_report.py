"""The report: brought up to date, and other people's folders left alone."""

from pathlib import Path

import pytest

from app.reproduce.catalog import CATALOG
from app.reproduce.report import Report, processor
from app.reproduce.result import Headline, Result, Table
from app.terminal.errors import UsageError


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
