"""The shape of a sheet in one more frame."""

import numpy as np
import pytest

from reconstruction.camera import Camera, lens
from reconstruction.mapping.isometric.adjustment import bundled, sheet
from reconstruction.mapping.isometric.one_frame import Foreseen, shape_in
from reconstruction.mapping.maps import LONG_LENS, map_of
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet
from tests.reconstruction.world import PERSPECTIVE, bending_sheet


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


@pytest.mark.parametrize("known", [0, 2, 5])
def test_nothing_is_foreseen_by_points_that_no_keyframe_placed(known: int) -> None:
    W, _ = bending_sheet(points=100)
    left = W[0, 0] < np.median(W[0, 0])
    found = map_of(W[:20], np.repeat(left[None], 20, axis=0), PERSPECTIVE, estimate_focal=False)
    assert found is not None
    assert found.sheet is not None
    seen = ~left
    seen[np.flatnonzero(left)[:known]] = True
    assert found.foreseen([(W[22], seen)]) == [None]
    assert found.foreseen([(W[22], left)]) != [None]
