"""The verdict on sheets, by their lengths, points, turn and camera, and on what is drawn flat."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from app.pipeline.quality.verdict import verdict
from reconstruction.basis.rest_shape import RestShape
from reconstruction.camera import Camera
from reconstruction.mapping.isometric.sheet import IsometricSheet
from reconstruction.mapping.map import Map
from reconstruction.mapping.solid.rivals import Misfit
from tests.app.pipeline.test_verdict import EVIDENCE, LEFT, REST, course

FLAT = RestShape("plane", replace(REST.motion, shape=REST.motion.shape * [[1], [1], [0]]), "")


@dataclass
class Sheet:
    """What a verdict asks of one."""

    stretch: float = 0.003
    strain_rms: float = 0.004
    points: int = 100
    by_focal: float = 0.0

    @property
    def warps(self) -> SimpleNamespace:
        return SimpleNamespace(weights=np.ones((30, self.points)))


def test_a_sheet_that_stretches_while_nothing_turns_may_be_anything() -> None:
    left = {"flat": Misfit(0.5, 0.5), "solid": Misfit(0.3, 0.45)}
    still = replace(EVIDENCE, kind="sheet", turn_degrees=10.0, **left)
    for stretch, sureness, grade in ((0.008, 1.5, "poor"), (0.003, 2.9, "fair"), (0.003, 3.1, "good")):
        sheet, told = cast(IsometricSheet, Sheet(stretch=stretch)), replace(still, sureness=sureness)
        found = Map(replace(REST, kind="isometric"), Camera(500.0), sheet, evidence=told)
        said = verdict(course([0.003] * 50), found)
        assert said.grade == grade
        assert ("turned by 10° alone" in said.reason) == (grade != "good")


@pytest.mark.parametrize(
    ("sheet", "focal_px", "grade", "says"),
    [
        (Sheet(), 500.0, "good", "many views"),
        (Sheet(), np.inf, "fair", "without perspective"),
        (Sheet(stretch=0.008), 500.0, "fair", "change by 0.8%"),
        (Sheet(stretch=0.008, strain_rms=0.02), 500.0, "poor", "change by 2.0%"),
        (Sheet(points=25), 500.0, "fair", "25 points"),
        (Sheet(by_focal=0.032), 500.0, "fair", "off by 3.2%"),
        (Sheet(by_focal=0.37), 500.0, "poor", "off by 37.0%"),
    ],
)
def test_a_sheet_by_its_lengths_points_and_camera(sheet: Sheet, focal_px: float, grade: str, says: str) -> None:
    evidence = replace(EVIDENCE, kind="sheet")
    found = Map(replace(REST, kind="isometric"), Camera(focal_px), cast(IsometricSheet, sheet), evidence=evidence)
    said = verdict(course([0.003] * 50), found)
    assert said.grade == grade
    assert says in said.reason


@pytest.mark.parametrize(("change", "grade"), [(0.045, "good"), (0.08, "poor")])
def test_a_sheet_has_the_same_lengths_by_either_half_of_the_keyframes(change: float, grade: str) -> None:
    evidence = replace(EVIDENCE, kind="sheet", length_change=change)
    found = Map(replace(REST, kind="isometric"), Camera(500.0), cast(IsometricSheet, Sheet()), evidence=evidence)
    said = verdict(course([0.003] * 50), found)
    assert said.grade == grade
    assert ("half to half" in said.reason) == (grade == "poor")


@pytest.mark.parametrize("sureness", [1.05, 1.35])
@pytest.mark.parametrize(("sheet_px", "solid_px", "grade"), [(0.3, 0.3, "good"), (0.2, 0.3, "fair"), (0.3, 0.2, "fair")])
def test_a_flat_sheet_may_as_well_be_a_solid_without_relief(
    sheet_px: float, solid_px: float, grade: str, sureness: float
) -> None:
    solid, sheet = Misfit(solid_px, solid_px), Misfit(sheet_px, np.nan)
    known = replace(EVIDENCE, kind="flat", flat=LEFT, solid=solid, sheet=sheet, sureness=sureness)
    said = verdict(course([0.001] * 50), Map(FLAT, Camera(500.0), evidence=known))
    assert said.grade == grade
    assert "a flat sheet in many views" in said.reason or grade == "fair"


@pytest.mark.parametrize(
    ("left_px", "others_px", "told_px", "grade"),
    [(2.0, 1.0, np.nan, "poor"), (2.0, 1.5, np.nan, "fair"), (2.0, 1.5, 1.0, "poor"), (0.25, 0.12, 0.1, "fair")],
)
def test_what_bends_is_drawn_flat(left_px: float, others_px: float, told_px: float, grade: str) -> None:
    others = Misfit(others_px, others_px)
    known = replace(EVIDENCE, kind="flat", flat=Misfit(left_px, left_px), solid=others, sheet=others, told_px=told_px)
    said = verdict(course([0.001] * 50), Map(FLAT, Camera(), evidence=known))
    assert said.grade == grade
    assert ("2.0 times less" in said.reason) == (grade == "poor")


@pytest.mark.parametrize(("left_px", "focal", "grade"), [(0.7, np.inf, "fair"), (0.2, np.inf, "good"), (0.7, 500, "good")])
def test_what_is_drawn_flat_may_bend_the_other_way_without_perspective(left_px: float, focal: float, grade: str) -> None:
    left = Misfit(left_px, left_px)
    known = replace(EVIDENCE, kind="flat", flat=left, solid=left, sheet=left)
    said = verdict(course([0.001] * 50), Map(FLAT, Camera(focal), evidence=known))
    assert said.grade == grade
    assert ("mirror image" in said.reason) == (grade == "fair")
