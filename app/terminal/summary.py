"""What a command prints at its end: a table for people, JSON for programs."""

import json
import sys
from collections.abc import Mapping

from rich.console import Console
from rich.table import Table

PERCENT = ("visible_share", "visible_share_last", "e3d", "e3d_camera", "e3d_static", "e3d_sign_free")


def as_json(words: Mapping[str, object]) -> None:
    """One JSON object on stdout."""
    sys.stdout.write(json.dumps(words, indent=2) + "\n")


def as_table(title: str, words: Mapping[str, object]) -> None:
    """A table on stdout."""
    table = Table(title=title, show_header=False, title_justify="left")
    for name, value in words.items():
        if value is not None:
            table.add_row(name, in_words(name, value))
    Console().print(table)


def in_words(name: str, value: object) -> str:
    """A value as a person reads it."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {in_words(key, item)}" for key, item in value.items())
    if isinstance(value, float):
        return f"{value:.2%}" if name in PERCENT else f"{value:.4g}"
    return str(value)
