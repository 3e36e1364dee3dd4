"""A sheet that ends on the wrong side of its images is begun anew on the other."""

import numpy as np
import pytest

from reconstruction.evaluation import e3d
from reconstruction.mapping.isometric.adjustment import mirrored, on_smooth_images, sheet
from reconstruction.mapping.isometric.images.warps import smooth_warps
from tests.reconstruction.mapping.bending import CAMERA, lifted_page, waving_sheet


@pytest.mark.parametrize("seed", [0, 3])
def test_a_page_lifted_at_one_side_bends_to_that_side(seed: int) -> None:
    W, S = lifted_page(np.random.default_rng(seed))
    found = sheet(W, np.ones((len(W), W.shape[2]), bool), CAMERA)
    assert e3d(found.shapes(), S).mean() < 0.02


def test_what_keeps_its_lengths_does_not_on_the_other_side() -> None:
    W, _ = waving_sheet(np.random.default_rng(5))
    found = on_smooth_images(smooth_warps(W, np.ones((len(W), W.shape[2]), bool)), CAMERA)
    assert mirrored(found) is None
