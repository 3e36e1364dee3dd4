"""One frame ahead: order, errors, ends, and sources that are silent."""

import sys
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from app.pipeline.prefetch import SWITCH_S, Ahead
from tracking.video import Frame


def frames(count: int) -> Iterator[Frame]:
    yield from (Frame(i, i / 30, np.full((2, 2, 3), i, np.uint8)) for i in range(count))


def test_frames_come_in_order_and_prepared() -> None:
    prepared: list[int] = []
    with Ahead(frames(5), lambda frame: prepared.append(frame.index)) as ahead:
        for i in range(5):
            ahead.begin()
            frame = ahead.fetched()
            assert frame is not None
            assert frame.index == i
            ahead.prepared()
            assert prepared == list(range(i + 1))
        ahead.begin()
        assert ahead.fetched() is None
        ahead.prepared()
    assert prepared == list(range(5))


def test_threads_switch_fast_meanwhile_only() -> None:
    before = sys.getswitchinterval()
    with Ahead(frames(1), lambda _: None):
        assert sys.getswitchinterval() == pytest.approx(SWITCH_S)
    assert sys.getswitchinterval() == before


def test_it_works_while_the_caller_does() -> None:
    busy = threading.Event()
    with Ahead(frames(2), lambda _: busy.set()) as ahead:
        ahead.begin()
        assert busy.wait(5.0)  # nobody waited for it


def test_what_the_source_raises_is_raised_where_the_frame_is_wanted() -> None:
    def broken() -> Iterator[Frame]:
        yield from frames(1)
        raise OSError("unplugged")

    prepared: list[int] = []
    with Ahead(broken(), lambda frame: prepared.append(frame.index)) as ahead:
        ahead.begin()
        ahead.fetched()
        ahead.begin()
        with pytest.raises(OSError, match="unplugged"):
            ahead.fetched()
        ahead.prepared()
    assert prepared == [0]


def test_what_the_preparation_raises_is_raised() -> None:
    def fails(_: Frame) -> None:
        raise ValueError("no")

    with Ahead(frames(1), fails) as ahead:
        ahead.begin()
        assert ahead.fetched() is not None
        with pytest.raises(ValueError, match="no"):
            ahead.prepared()


def test_a_silent_source_is_not_waited_for() -> None:
    speak, ended = threading.Event(), threading.Event()

    def silent() -> Iterator[Frame]:
        speak.wait(60.0)
        ended.set()
        yield from frames(1)

    with Ahead(silent(), lambda _: None) as ahead:
        ahead.begin()
    assert not ended.is_set()
    speak.set()
