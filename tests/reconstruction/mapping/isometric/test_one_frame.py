"""The shape of a sheet in one more frame."""

import numpy as np
import pytest

from reconstruction.camera import Camera, lens
from reconstruction.mapping.isometric.adjustment import bundled, sheet
from reconstruction.mapping.isometric.one_frame import Foreseen, shape_in
from reconstruction.mapping.maps import LONG_LENS
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet


@pytest.mark.parametrize("perspective", [True, False])
def test_without_perspective_alone_a_sheet_goes_on_bending_the_other_way(perspective: bool) -> None:
    W, S = waving_sheet(np.random.default_rng(5))
    W = W if perspective else 200 * S[:, :2]
    seen = np.ones((len(W), W.shape[2]), bool)
    camera: Camera = CAMERA if perspective else lens(W, LONG_LENS)
    found = bundled(sheet(W, seen, camera), W)
    shape = found.shapes()[4]
    other_way = shape.copy()
    other_way[2] = 2 * shape[2].mean() - shape[2]
    last = Foreseen(other_way, found.usual_change)
    depth = shape_in(found, W[4], seen[4], last).shape[2]
    alike = np.corrcoef(depth, shape[2])[0, 1]
    assert alike > 0.95 if perspective else alike < -0.95
