"""Results as Markdown."""

from app.reproduce.result import markdown_table


def test_cells_of_tables() -> None:
    text = markdown_table(["what", "number"], [["a|b", 1.234], ["c", None], ["d", 7]])
    assert text.splitlines() == ["| what | number |", "| --- | ---: |", "| a\\|b | 1.23 |", "| c | – |", "| d | 7 |"]
