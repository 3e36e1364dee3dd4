"""Tables in a README that commands bring up to date, each between two marks of its own."""

from pathlib import Path

from app.files.writing import writable
from app.terminal.errors import UsageError


def with_table(readme: Path, name: str, table: str) -> str:
    """The README with a table between the marks `<!-- NAME: begin -->` and `<!-- NAME: end -->`.

    Raises:
        UsageError: the file cannot be read, or has no such marks in this order.
    """
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    try:
        text = readme.read_text()
    except OSError as error:
        raise UsageError(f"cannot read --readme {readme}: {error.strerror}") from None
    head, found, rest = text.partition(begin)
    _, closed, tail = rest.partition(end)
    if not (found and closed):
        raise UsageError(f"--readme {readme} has no place for the table: put in the lines {begin} and {end}")
    return f"{head}{begin}\n{table}{end}{tail}"


def put_table(readme: Path, name: str, table: str) -> None:
    """Write the README with the table in it; errors as of `with_table` and `writable`."""
    text = with_table(readme, name, table)
    with writable(readme) as file:
        file.write(text.encode())
