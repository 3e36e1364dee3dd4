"""What is foreseen of frames comes in their order, whatever chunks they were in, and wherever it was made."""

import numpy as np

from reconstruction.mapping.foresight import ELSEWHERE, Foresight
from reconstruction.mapping.start import at_once
from tests.reconstruction.mapping.test_map import POINTS, waving


def test_each_frame_gets_what_its_chunk_tells_of_it() -> None:
    W, _, found = waving()
    seen, few = np.ones(POINTS, bool), np.arange(POINTS) < 3
    frames = [(w, few if k == 2 else seen) for k, w in enumerate(W[:8])]
    chunks, foresight, theirs = (frames[:4], [], frames[4:]), Foresight(at_once), round(4 * ELSEWHERE)
    for chunk in chunks:
        foresight.begin(found, chunk)
    parts = [part for chunk in chunks for part in (chunk[:theirs], chunk[theirs:])]
    for k, alone in enumerate(one for part in parts for one in found.foreseen(part)):
        foreseen = foresight.next()
        assert (foreseen is None, alone is None) == (k == 2,) * 2
        if foreseen is not None and alone is not None:
            np.testing.assert_array_equal(foreseen.shape, alone.shape)
    assert foresight.next() is None
