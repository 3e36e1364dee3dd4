"""Sheets with bends that the usual functions cut off."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest

from reconstruction.evaluation import e3d
from reconstruction.mapping import maps
from reconstruction.mapping.maps import map_of
from reconstruction.mapping.selection import Evidence, Surface
from tests.reconstruction.mapping.bending import CAMERA, waving_sheet
from tests.reconstruction.mapping.test_map import FRAMES, POINTS, waving


@pytest.mark.slow
def test_bends_that_the_usual_functions_cut_off_are_followed_by_finer_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    W, S = waving_sheet(np.random.default_rng(5), FRAMES, amplitude=0.9, points=POINTS)
    every = np.ones((FRAMES, POINTS), bool)
    errors = []
    for most in (np.inf, maps.USUAL_STRETCH):
        monkeypatch.setattr(maps, "USUAL_STRETCH", most)
        found = map_of(W, every, CAMERA, estimate_focal=False, last=lambda: (W, every))
        assert found is not None
        assert found.sheet is not None
        errors.append(e3d(found.sheet.shapes(), S).mean())
    assert errors[1] < 0.8 * errors[0]


def test_a_sheet_that_only_its_stretch_speaks_against_is_judged_by_finer_functions_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    W, _, usual = waving()
    every, shown = np.ones((FRAMES // 2, POINTS), bool), []
    assert usual.evidence is not None
    said = [replace(usual.evidence, kind="solid", sureness=0.6), usual.evidence]

    def select(*arguments: object) -> Evidence:
        surface = cast(Surface, arguments[3])
        shown.append(surface((np.arange(0, FRAMES // 2, 2), np.arange(1, FRAMES // 2, 2)))[1])
        return said[len(shown) - 1]

    monkeypatch.setattr(maps, "select", select)
    found = map_of(W[::2], every, CAMERA, estimate_focal=False)
    assert (found and found.rest.kind, len(shown)) == ("rigid", 1)  # on the way there is no time for it
    shown.clear()
    found = map_of(W[::2], every, CAMERA, estimate_focal=False, last=lambda: (W[::2], every))
    assert (found and found.rest.kind, len(shown)) == ("isometric", 2)
    assert shown[0] != shown[1]
