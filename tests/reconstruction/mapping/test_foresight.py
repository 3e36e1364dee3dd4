"""What is foreseen of frames comes in their order, whatever chunks they were in."""

import numpy as np

from reconstruction.mapping.foresight import Foresight
from reconstruction.mapping.start import at_once
from tests.reconstruction.mapping.test_map import POINTS, waving


def test_each_frame_gets_what_its_chunk_tells_of_it() -> None:
    W, _, found = waving()
    seen, few = np.ones(POINTS, bool), np.arange(POINTS) < 3
    frames = [(w, few if k == 2 else seen) for k, w in enumerate(W[:6])]
    chunks, foresight = (frames[:3], [], frames[3:]), Foresight(at_once)
    for chunk in chunks:
        foresight.begin(found, chunk)
    for k, alone in enumerate(one for chunk in chunks for one in found.foreseen(chunk)):
        foreseen = foresight.next()
        assert (foreseen is None, alone is None) == (k == 2,) * 2
        if foreseen is not None and alone is not None:
            np.testing.assert_array_equal(foreseen.shape, alone.shape)
    assert foresight.next() is None
