"""Processes of our own."""

import os

import pytest

from app.processes.child import NICEST, child


@pytest.mark.parametrize("nice", [0, NICEST])
def test_a_child_is_as_nice_as_asked_for_among_its_own(nice: int) -> None:
    process, connection = child("app.pipeline.stages.maps", nice=nice)
    with connection:
        assert os.getpriority(os.PRIO_PROCESS, process.pid) == min(nice + os.getpriority(os.PRIO_PROCESS, 0), NICEST)
        assert os.getsid(process.pid) == os.getsid(0)  # niceness counts within a session
        assert os.getpgid(process.pid) == process.pid  # Ctrl-C is not for it
    process.wait()
