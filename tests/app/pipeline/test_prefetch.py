"""One frame ahead: order, errors, ends, and sources that are silent."""

import sys
import threading
from collections.abc import Iterator

import numpy as np
import pytest

from app.pipeline.prefetch import SWITCH_S, Prefetch
from tracking.video import Frame


def frames(count: int) -> Iterator[Frame]:
    yield from (Frame(i, i / 30, np.full((2, 2, 3), i, np.uint8)) for i in range(count))


def test_frames_come_in_order_and_prepared() -> None:
    prepared: list[int] = []
    with Prefetch(frames(5)) as prefetch:
        for i in range(5):
            prefetch.begin(lambda frame: prepared.append(frame.index))
            frame = prefetch.fetched()
            assert frame is not None
            assert frame.index == i
            prefetch.prepared()
            assert prepared == list(range(i + 1))
        prefetch.begin(lambda frame: prepared.append(frame.index))
        assert prefetch.fetched() is None
        prefetch.prepared()
    assert prepared == list(range(5))


def test_threads_switch_fast_meanwhile_only() -> None:
    before = sys.getswitchinterval()
    with Prefetch(frames(1)):
        assert sys.getswitchinterval() == pytest.approx(SWITCH_S)
    assert sys.getswitchinterval() == before


def test_it_works_while_the_caller_does() -> None:
    busy = threading.Event()
    with Prefetch(frames(2)) as prefetch:
        prefetch.begin(lambda _: busy.set())
        assert busy.wait(5.0)  # nobody waited for it


def test_what_the_source_raises_is_raised_where_the_frame_is_wanted() -> None:
    def broken() -> Iterator[Frame]:
        yield from frames(1)
        raise OSError("unplugged")

    prepared: list[int] = []
    with Prefetch(broken()) as prefetch:
        prefetch.begin(lambda frame: prepared.append(frame.index))
        prefetch.fetched()
        prefetch.begin(lambda frame: prepared.append(frame.index))
        with pytest.raises(OSError, match="unplugged"):
            prefetch.fetched()
        prefetch.prepared()
    assert prepared == [0]


def test_what_the_preparation_raises_is_raised() -> None:
    def fails(_: Frame) -> None:
        raise ValueError("no")

    with Prefetch(frames(1)) as prefetch:
        prefetch.begin(fails)
        assert prefetch.fetched() is not None
        with pytest.raises(ValueError, match="no"):
            prefetch.prepared()


def test_a_silent_source_is_not_waited_for() -> None:
    speak, ended = threading.Event(), threading.Event()

    def silent() -> Iterator[Frame]:
        speak.wait(60.0)
        ended.set()
        yield from frames(1)

    with Prefetch(silent()) as prefetch:
        prefetch.begin(lambda _: None)
    assert not ended.is_set()
    speak.set()
