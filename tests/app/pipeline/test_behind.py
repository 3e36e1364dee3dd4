"""A recording in another thread: everything in order, and what goes wrong is heard."""

import threading
from typing import cast

import numpy as np
import pytest

from app.pipeline.behind import MOST_WAITING, Behind
from app.pipeline.parts import Parts
from app.terminal.errors import UsageError
from tracking.klt import Observation
from tracking.video import Frame


class Notes:
    """Parts that note what they are told, and by which thread."""

    def __init__(self, fail_at: int | None = None) -> None:
        self.told: list[object] = []
        self.threads: set[str] = set()
        self.fail_at = fail_at
        self.words = {"recording": "notes.rrd"}

    def observe(self, frame: Frame, observation: Observation, *, phase: str) -> None:  # noqa: ARG002
        self._note(("frame", frame.index, phase))

    def timing(self, index: int, time_s: float, stage_ms: dict[str, float]) -> None:  # noqa: ARG002
        self._note(("timing", index, dict(stage_ms)))

    def event(self, index: int, time_s: float, text: str, level: str = "INFO") -> None:  # noqa: ARG002
        self._note(("event", index, text, level))

    def finish(self) -> None:
        self.told.append("finish")

    def __enter__(self) -> None:
        self.told.append("enter")

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.told.append(("exit", error))

    def _note(self, what: tuple[object, ...]) -> None:
        if what[1] == self.fail_at:
            raise UsageError("the disk is full")
        self.told.append(what)
        self.threads.add(threading.current_thread().name)


def observe(behind: Behind, index: int) -> None:
    frame = Frame(index, index / 30, np.zeros((2, 2, 3), np.uint8))
    behind.observe(frame, Observation(np.zeros((1, 2)), np.ones(1, np.bool_)), phase="tracking")


def behind(notes: Notes) -> Behind:
    return Behind(cast(Parts, notes))


def test_everything_is_written_in_order_by_one_thread() -> None:
    notes, stage_ms = Notes(), {"track": 1.0}
    with behind(notes) as recording:
        for i in range(3 * MOST_WAITING):
            observe(recording, i)
        recording.timing(7, 0.1, stage_ms)
        stage_ms.clear()
        recording.event(8, 0.2, "lost", "WARN")
        recording.finish()
        assert recording.words == {"recording": "notes.rrd"}
    frames = [("frame", i, "tracking") for i in range(3 * MOST_WAITING)]
    last = [("timing", 7, {"track": 1.0}), ("event", 8, "lost", "WARN"), "finish", ("exit", None)]
    assert notes.told == ["enter", *frames, *last]
    assert notes.threads == {"record"}


def test_what_goes_wrong_is_raised_and_nothing_more_is_written() -> None:
    notes = Notes(fail_at=3)
    with pytest.raises(UsageError, match="disk is full"), behind(notes) as recording:  # noqa: PT012 - heard sooner or later
        for i in range(10 * MOST_WAITING):
            observe(recording, i)
    assert [what[1] for what in notes.told[1:-1]] == [0, 1, 2]  # type: ignore[index]
    assert isinstance(notes.told[-1], tuple)


def test_what_goes_wrong_at_the_end_is_raised_before_the_summary() -> None:
    notes = Notes(fail_at=0)
    with pytest.raises(UsageError, match="disk is full"), behind(notes) as recording:  # noqa: PT012
        observe(recording, 0)
        recording.finish()
    assert "finish" not in notes.told


def test_without_a_summary_it_is_raised_all_the_same() -> None:
    notes = Notes(fail_at=0)
    with pytest.raises(UsageError, match="disk is full"), behind(notes) as recording:
        observe(recording, 0)


def test_what_ended_the_run_matters_more() -> None:
    notes = Notes(fail_at=0)
    with pytest.raises(RuntimeError, match="camera"), behind(notes) as recording:  # noqa: PT012
        observe(recording, 0)
        raise RuntimeError("camera")
    assert isinstance(notes.told[-1], tuple)
    assert isinstance(notes.told[-1][1], RuntimeError)
