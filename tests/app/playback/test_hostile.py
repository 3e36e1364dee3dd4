"""Recordings that Rerun reads, and that hold what cannot be; and one that ends the process that reads it."""

import json
from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np
import pytest

from app.playback.playback import Playback
from app.playback.reading import file as reading
from app.playback.reading.rows import Row, Rows
from app.terminal.errors import UsageError
from tests.synthetic_run import Run

Change = Callable[[np.ndarray], Any]


def set_to(place: int, value: float) -> Change:
    def change(values: np.ndarray) -> np.ndarray:
        changed = values.copy()
        changed.reshape(-1)[place] = value
        return changed

    return change


CHANGES: list[tuple[str, Change]] = [
    ("modeshape.Model:faces", set_to(0, 4000)),
    ("modeshape.Model:edges", set_to(0, 4000)),
    ("modeshape.Model:faces", lambda _: np.empty((0, 3))),
    ("modeshape.Model:rest", set_to(5, np.nan)),
    ("modeshape.Model:rest", np.zeros_like),
    ("modeshape.Model:rest", lambda values: values[:-1]),
    ("modeshape.Model:Upsilon", set_to(0, np.inf)),
    ("modeshape.Model:Phi", np.zeros_like),
    ("modeshape.Model:focal_px", set_to(0, -1.0)),
    ("modeshape.Model:size", set_to(0, 0)),
    ("modeshape.Model:size", set_to(0, 1e12)),
    ("modeshape.Model:texture_px", set_to(0, np.nan)),
    ("modeshape.Estimate:s", set_to(0, 0.0)),
    ("modeshape.Estimate:t", set_to(0, np.nan)),
    ("modeshape.Estimate:Lambda", set_to(0, 1e300)),
    ("modeshape.Estimate:quaternion", np.zeros_like),
    ("modeshape.Estimate:model", set_to(0, -3)),
    ("modeshape.Estimate:model", set_to(0, 7)),
    ("modeshape.Observation:visible", lambda values: values[:-1]),
    ("Points2D:positions", set_to(0, np.nan)),
    ("modeshape.Document:json", lambda _: [json.dumps([1, 2])]),
    ("modeshape.Document:json", lambda _: ["{"]),
]


@pytest.mark.parametrize(("component", "change"), CHANGES, ids=[f"{i}-{name}" for i, (name, _) in enumerate(CHANGES)])
def test_what_cannot_be_is_refused(run: Run, monkeypatch: pytest.MonkeyPatch, component: str, change: Change) -> None:
    rows = reading.RecordingFile.rows

    def changed(self: reading.RecordingFile, *wanted: tuple[str, str]) -> Rows:
        found = rows(self, *wanted)
        for (_, name), many in found.found.items():
            if name == component:
                many[:] = [Row(row.id, row.frame, row.time_s, change(row.value)) for row in many]  # type: ignore[arg-type]
        return found

    monkeypatch.setattr(reading.RecordingFile, "rows", changed)
    with pytest.raises(UsageError, match=r"sheet\.rrd is not a recording that this version of modeshape can read"):
        Playback.load(run.path)


def test_a_reader_that_ends_is_told(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    ask = reading.Reader.ask

    def killed(self: reading.Reader, message: object) -> None:
        ask(self, message)
        self.end.peek()[2][0].kill()  # type: ignore[index]

    monkeypatch.setattr(reading.Reader, "ask", killed)
    with pytest.raises(UsageError, match=r"sheet\.rrd is damaged"):
        Playback.load(run.path)


def test_pictures_are_of_one_size(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    playback = Playback.load(run.path)
    sides = count(3)
    monkeypatch.setattr("app.playback.images.decoded", lambda _: np.zeros((next(sides), 4, 3), np.uint8))
    with pytest.raises(UsageError, match="pictures of several sizes"):
        list(playback.images())
