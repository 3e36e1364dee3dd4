"""A summary is told the same way by every command."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.terminal.exit_code import ExitCode
from app.terminal.summary import Summary


@dataclass(frozen=True)
class Scores(Summary):
    e3d: float


@dataclass(frozen=True, kw_only=True)
class Example(Summary):
    frames: int
    note: str = ""
    out: Path | None
    scores: Scores | None = None
    stages: dict[str, float]


def test_fields_are_told_in_order_and_defaults_left_out() -> None:
    example = Example(frames=3, out=None, stages={"track": 1.0})
    assert json.loads(example.as_json()) == {"frames": 3, "out": None, "stages": {"track": 1.0}}
    assert list(example.as_dict()) == ["frames", "out", "stages"]
    assert example.exit_code == ExitCode.DONE


def test_a_summary_in_a_summary_is_told_field_by_field() -> None:
    example = Example(frames=3, note="short", out=Path("a.npz"), scores=Scores(0.025), stages={})
    assert example.as_dict() == {"frames": 3, "note": "short", "out": "a.npz", "e3d": 0.025, "stages": {}}


def test_people_read_percent_and_four_digits(capsys: pytest.CaptureFixture[str]) -> None:
    Example(frames=3, out=None, scores=Scores(0.025), stages={"track": 1.23456}).print_table()
    table = capsys.readouterr().out
    for text in ("frames", "2.50%", "track 1.235"):
        assert text in table
    assert "out" not in table
