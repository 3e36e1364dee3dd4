"""What an experiment gives: tables, figures, remarks and headlines; as JSON and as Markdown."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field


@dataclass(frozen=True)
class Table:
    """Rows of cells under column names: text, whole numbers, floats with two decimals, None as a dash."""

    title: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[object]]

    def __post_init__(self) -> None:
        for row in self.rows:
            assert len(row) == len(self.columns), (self.title, row)


@dataclass(frozen=True)
class Headline:
    """A row of the README's table: errors in %, and what others reach."""

    data: str
    setting: str
    e3d: float | None
    e3d_static: float | None
    others: str = ""


@dataclass(frozen=True)
class Result:
    """Outcome of an experiment.

    Attributes:
        tables: its numbers.
        figures: by name of the file, pictures that may be published.
        footage: by name of the file, pictures that show other people's data.
        remarks: what is to be seen, in sentences, all computed.
        headlines: rows for the README.
    """

    tables: list[Table] = field(default_factory=list)
    figures: dict[str, bytes] = field(default_factory=dict)
    footage: dict[str, bytes] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    headlines: list[Headline] = field(default_factory=list)

    def as_words(self) -> dict[str, object]:
        """Everything but the pictures themselves."""
        return {
            "tables": [asdict(table) for table in self.tables],
            "figures": list(self.figures),
            "footage": list(self.footage),
            "remarks": self.remarks,
            "headlines": [asdict(headline) for headline in self.headlines],
        }


def percent(share: float | None) -> float | None:
    """A share of one in %, to what is worth telling."""
    return None if share is None else round(100 * share, 3)


def in_cell(value: object) -> str:
    """A cell of a Markdown table."""
    if value is None:
        return "–"
    return f"{value:.2f}" if isinstance(value, float) else str(value).replace("|", "\\|")


def markdown_table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table; columns whose cells are all numbers or dashes are flush right."""
    numeric = [all(row[i] is None or isinstance(row[i], int | float) for row in rows) for i in range(len(columns))]
    lines = [
        list(columns),
        ["---:" if right else "---" for right in numeric],
        *[[in_cell(cell) for cell in row] for row in rows],
    ]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines) + "\n"
