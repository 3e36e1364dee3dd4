"""What a run begins with."""

import numpy as np
import pytest

from app.options.run import Run
from app.pipeline.prepare import estimator
from reconstruction.mapping.start import at_once


@pytest.mark.parametrize("size", [(640, 360), (360, 640)])
def test_the_lens_is_assumed_by_the_longer_side(size: tuple[int, int]) -> None:
    found = estimator(Run("a.mp4"), size, np.zeros((9, 2)), at_once, None)
    assert found.camera.focal_px == 640
    np.testing.assert_array_equal(found.camera.center_px, np.array(size) / 2)
