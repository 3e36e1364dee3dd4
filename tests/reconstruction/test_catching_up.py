"""Frames that waited for the first model get their shapes while others come."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.mapping.mapper import CATCH_UP, LIVE_CATCH_UP, Mapper
from reconstruction.online import Reconstruction
from tests.reconstruction.runs import FRAMES, POINTS, SETTINGS, swelling_hill
from tests.reconstruction.world import PERSPECTIVE


@pytest.mark.parametrize(("latency", "live", "most"), [(0, False, 12), (90, False, CATCH_UP), (90, True, LIVE_CATCH_UP)])
def test_frames_that_waited_come_a_few_at_a_time(latency: int, live: bool, most: int) -> None:
    W, _ = swelling_hill()
    settings = replace(SETTINGS, rest_shape="rigid", bootstrap_frames=12)
    reconstruction = Reconstruction(PERSPECTIVE, settings, mapper=Mapper(settings, latency=latency, live=live))
    visible = np.ones(POINTS, bool)
    shapes = [reconstruction.update(image, visible) for image in W]
    counts = [len(some) for some in shapes if some]
    assert (counts[0], max(counts), counts[-1]) == (most, most, 1)
    assert [one.frame for some in shapes for one in some] == list(range(FRAMES))
