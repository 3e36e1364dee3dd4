"""Frames wait for their shapes, but not for ever."""

import numpy as np
import pytest

from app.pipeline.processed import InOrder
from tracking.observation import Observation
from tracking.video import Frame


def test_pictures_that_wait_have_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    picture = np.zeros((10, 10, 3), np.uint8)
    monkeypatch.setattr("app.pipeline.processed.MOST_BYTES", 5 * picture.nbytes)
    order, nothing = InOrder(), Observation(np.zeros((0, 2)), np.zeros(0, bool))
    for index in range(8):
        order.add(Frame(index, index / 30, picture), nothing)
    given_up = list(order.ready())
    assert [one.frame.index for one in given_up] == [0, 1, 2]
    assert all(one.estimate is None for one in given_up)
    order.end(None)
    assert [one.frame.index for one in order.ready()] == [3, 4, 5, 6, 7]
