"""What a command prints at its end: a table for people, JSON for programs."""

import json
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from math import isfinite
from pathlib import Path

from rich.table import Table

from app.terminal.exit_code import ExitCode
from app.terminal.streams import Tables

PERCENT = ("visible_share", "visible_share_last", "e3d", "e3d_camera", "e3d_static", "e3d_sign_free", "e3d_online")


@dataclass(frozen=True)
class Summary:
    """What came of a command; its fields are the keys of the JSON and the rows of the table, in their order.

    A field with a default is left out where it has this value. One that is a summary itself is told field by field.
    """

    def as_dict(self) -> dict[str, object]:
        """The fields by name, ready for JSON."""
        words: dict[str, object] = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, Summary):
                words |= value.as_dict()
            elif field.default is MISSING or value != field.default:
                words[field.name] = str(value) if isinstance(value, Path) else value
        return words

    def as_json(self) -> str:
        """One JSON object."""
        return json.dumps(finite(self.as_dict()), indent=2, allow_nan=False)

    def print_table(self) -> None:
        """All of it as a table on stdout."""
        print_rows(self.as_dict())

    def print_short(self) -> None:
        """What most people want to know, in at most ten lines on stdout."""
        self.print_table()

    @property
    def hint(self) -> str:
        """What to do next, for people; empty if there is nothing to say."""
        return ""

    @property
    def exit_code(self) -> ExitCode:
        """How the command ended."""
        return ExitCode.DONE


def finite(value: object) -> object:
    """The same with None in place of numbers that JSON does not have."""
    if isinstance(value, Mapping):
        return {name: finite(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def print_rows(words: Mapping[str, object]) -> None:
    """Names and values as a table on stdout; rows without a value are left out."""
    table = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    for name, value in words.items():
        if value is not None:
            table.add_row(name, in_words(name, value))
    Tables().print(table)


def print_lines(headline: str, rows: Mapping[str, object]) -> None:
    """A line, and names and values under it, on stdout."""
    Tables().print(headline)
    print_rows(rows)


def in_words(name: str, value: object) -> str:
    """A value as a person reads it."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {in_words(key, item)}" for key, item in value.items())
    if isinstance(value, float):
        return f"{value:.2%}" if name in PERCENT else f"{value:.4g}"
    return str(value)
