"""Models from another process: the same, errors too; and nothing is left of it."""

import signal
from time import sleep

import numpy as np
import pytest

from app.pipeline.stages.maps import MapProcess
from app.terminal.errors import UsageError
from reconstruction import ReconstructionError
from reconstruction.camera import Camera
from reconstruction.mapping.first.bootstrap import bootstrap
from reconstruction.settings import Settings
from tests.reconstruction.runs import PERSPECTIVE, swelling_hill


def test_a_model_is_the_same_from_there() -> None:
    W, _ = swelling_hill()
    arguments = W, np.ones((len(W), W.shape[2]), bool), PERSPECTIVE, Settings(), True
    with MapProcess() as maps:
        there = maps.begin(bootstrap, *arguments)
        here = bootstrap(*arguments)
        found = there.result()
    assert here is not None
    np.testing.assert_array_equal(found.rest.motion.shape, here.rest.motion.shape)
    assert found.rest.note == here.rest.note


def test_arguments_are_those_of_the_call() -> None:
    values = [1, 2]
    with MapProcess() as maps:
        maps.begin(sleep, 0.1)  # what comes after it is not sent yet
        there = maps.begin(sum, values)
        values.append(3)
        assert there.result() == 3


def test_errors_come_back() -> None:
    W = np.random.default_rng(0).normal(size=(3, 2, 3))
    with MapProcess() as maps, pytest.raises(ReconstructionError, match="fewer than 4 points"):
        maps.begin(bootstrap, W, np.ones((3, 3), bool), Camera(), Settings(), True).result()


def test_a_killed_process_is_told_of() -> None:
    with MapProcess() as maps:
        maps._remote.end()
        with pytest.raises(UsageError, match="has ended"):
            maps.begin(len, ()).result()


def test_it_ends_whatever_it_does() -> None:
    with MapProcess() as maps:
        waiting = maps.begin(signal.pause)
    with pytest.raises(UsageError, match="has ended"):
        waiting.result()


def test_a_terminal_does_not_stop_what_writes_to_it_from_the_background() -> None:
    with MapProcess() as maps:
        assert maps.begin(signal.getsignal, signal.SIGTTOU).result() == signal.SIG_IGN
