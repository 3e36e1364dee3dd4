"""Tables between the marks of a README."""

from pathlib import Path

import pytest

from app.files.readme import put_table, with_table
from app.terminal.errors import UsageError


def test_the_readme_keeps_all_but_the_table(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text("before\n<!-- x: begin -->\nold\n<!-- x: end -->\nafter\n")
    put_table(readme, "x", "new\n")
    assert readme.read_text() == "before\n<!-- x: begin -->\nnew\n<!-- x: end -->\nafter\n"


@pytest.mark.parametrize("text", ["nothing", "<!-- x: end --> <!-- x: begin -->", "<!-- x: begin -->", "<!-- y: begin -->"])
def test_one_without_a_place_is_refused(tmp_path: Path, text: str) -> None:
    readme = tmp_path / "README.md"
    with pytest.raises(UsageError, match="cannot read --readme"):
        with_table(readme, "x", "new\n")
    readme.write_text(text)
    with pytest.raises(UsageError, match="has no place for the table: put in the lines <!-- x: begin -->"):
        put_table(readme, "x", "new\n")
    assert readme.read_text() == text


@pytest.mark.parametrize("name", ["bench", "reproduce"])
def test_our_readme_has_places_for_its_tables(name: str) -> None:
    assert "new\n" in with_table(Path(__file__).parents[3] / "README.md", name, "new\n")
