"""The verdict on a run, by what its frames and keyframes tell."""

from dataclasses import replace

import numpy as np
import pytest

from app.arrays import Flags
from app.pipeline.quality.course import Course
from app.pipeline.quality.frames import longest
from app.pipeline.quality.verdict import verdict
from reconstruction.basis.rest_shape import Kind, RestShape, RigidMotion
from reconstruction.camera import Camera
from reconstruction.mapping.map import Map
from reconstruction.mapping.selection import Evidence
from reconstruction.mapping.solid.deforming.deformations import Deformations
from reconstruction.mapping.solid.rivals import Misfit
from reconstruction.mapping.solid.solid import relief

REST = RestShape("rigid", RigidMotion(100 * np.tile(np.eye(3, 9), 3), np.eye(3)[None], np.ones(1), np.zeros((1, 2))), "")
LEFT = Misfit(0.3, 0.3)
EVIDENCE = Evidence(Misfit(2.0, 2.0), LEFT, 30.0, relief(REST.motion.shape), "solid", LEFT, 0.005, 2.0)
SOLID = Map(REST, Camera(), evidence=EVIDENCE)


def shown(seen: Flags) -> Map:
    """The solid with keyframes (K, p) that show it so."""
    count, points = seen.shape
    shape = np.tile(REST.motion.shape, 2)[:, :points]
    motion = RigidMotion(shape, np.tile(np.eye(3), (count, 1, 1)), np.ones(count), np.zeros((count, 2)))
    return replace(SOLID, rest=replace(REST, motion=motion), seen=seen)


def course(errors: list[float], shares: float = 1.0) -> Course:
    made = Course()
    for frame, error in enumerate(errors, 100):
        made.frames.append(frame)
        made.errors.append(error)
        made.errors_px.append(100 * error)
        made.shares.append(shares)
    return made


def test_all_is_well() -> None:
    said = verdict(course([0.003] * 50), SOLID)
    assert said.grade == "good"
    assert "0.3 px" in said.reason


def test_where_it_goes_wrong() -> None:
    said = verdict(course([0.003] * 15 + [0.045] * 20), SOLID)
    assert said.grade == "poor"
    assert "4.5 px off from frame 115 on" in said.reason
    assert "--roi" in said.reason
    assert "in frames 115 to 124" in verdict(course([0.003] * 15 + [0.045] * 10 + [0.003] * 20), SOLID).reason
    assert "throughout" in verdict(course([0.012] * 50), SOLID).reason


def test_a_moment_is_no_matter() -> None:
    assert verdict(course([0.003] * 50 + [0.045] * 2 + [0.003] * 50), SOLID).grade == "good"


@pytest.mark.parametrize("kind", ["rigid", "plane", "isometric"])
def test_nothing_known_but_the_first_frames(kind: Kind) -> None:
    said = verdict(course([0.001] * 50), replace(SOLID, evidence=None, rest=replace(REST, kind=kind)))
    assert said.grade == "fair"
    assert "film it" in said.reason


GIVEN = replace(SOLID, evidence=None, rest=replace(REST, kind="truth"))


@pytest.mark.parametrize("found", [SOLID, GIVEN], ids=["own", "given"])
def test_what_few_points_carry_is_a_guess(found: Map) -> None:
    assert verdict(course([0.001] * 50), found).grade == "good"
    few = replace(found.rest, motion=replace(REST.motion, shape=REST.motion.shape[:, :15]))
    said = verdict(course([0.001] * 50), replace(found, rest=few))
    assert said.grade == "fair"
    assert "by 15 points" in said.reason


@pytest.mark.parametrize(("focal", "grade"), [(np.inf, "fair"), (500.0, "good")])
def test_a_flat_shape_that_is_given_may_bend_the_other_way_without_perspective(focal: float, grade: str) -> None:
    flat = replace(REST, kind="mesh", motion=replace(REST.motion, shape=REST.motion.shape * [[1.0], [1.0], [0.0]]))
    assert flat.flat
    said = verdict(course([0.001] * 50), replace(SOLID, rest=flat, camera=Camera(focal), evidence=None))
    assert said.grade == grade
    assert ("mirror image" in said.reason) == (grade == "fair")


def test_what_may_as_well_be_something_else() -> None:
    said = verdict(course([0.001] * 50), replace(SOLID, evidence=replace(EVIDENCE, sureness=1.02)))
    assert said.grade == "fair"
    assert "depth may be a guess" in said.reason


@pytest.mark.parametrize(
    ("whole_px", "edges_px", "turn_degrees", "grade"),
    [(1.5, 0.5, 60.0, "fair"), (1.5, 0.5, 5.0, "poor"), (0.5, 0.2, 60.0, "good"), (0.5, 0.2, 12.0, "fair"),
     (1.2, 1.2, 30.0, "good"), (1.6, 1.6, 60.0, "fair"), (1.6, 0.5, 60.0, "fair"), (1.6, 0.5, 30.0, "fair"),
     (2.5, 2.5, 60.0, "poor"), (4.6, 4.0, 60.0, "poor")],
    ids=["changes", "and hardly turns", "hardly changes", "nor turns", "noise", "much of it", "changes much",
         "and turns less", "too much", "is no solid"],
)  # fmt: skip
def test_the_depth_of_a_solid_that_changes(whole_px: float, edges_px: float, turn_degrees: float, grade: str) -> None:
    plane = EVIDENCE.flat if turn_degrees < 25.0 else Misfit(20.0, 20.0)
    seen = replace(EVIDENCE, flat=plane, solid=Misfit(edges_px, whole_px), turn_degrees=turn_degrees)
    for size in (1.0, 5.0):  # of another model, as large as the one before
        said = verdict(course([0.001] * 50), replace(SOLID, evidence=seen).scaled(size))
        assert said.grade == grade
        assert ("how deep it is is a guess" in said.reason) == (grade != "good")


def test_a_shape_that_is_too_deep_seems_to_change_no_less() -> None:
    deep = replace(REST, motion=replace(REST.motion, shape=REST.motion.shape * [[1], [1], [3]]))
    evidence = replace(EVIDENCE, flat=Misfit(20.0, 20.0), solid=Misfit(2.5, 2.5), turn_degrees=60.0)
    assert verdict(course([0.001] * 50), replace(SOLID, rest=deep, evidence=evidence)).grade == "poor"


@pytest.mark.parametrize(("turn_degrees", "grade"), [(30.0, "fair"), (150.0, "poor")])
@pytest.mark.parametrize("factor", [0.5, 2.0, -1.0])
def test_a_solid_that_half_of_the_keyframes_find_otherwise(factor: float, turn_degrees: float, grade: str) -> None:
    lump = np.random.default_rng(0).normal(size=(3, 40))
    solid = replace(SOLID, rest=replace(REST, motion=replace(REST.motion, shape=100 * lump)), camera=Camera(500.0))
    turned = 3 * np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) @ lump
    turned[:, :5] = np.nan
    half = replace(EVIDENCE, turn_degrees=turn_degrees, shape=turned)
    assert verdict(course([0.001] * 50), replace(solid, evidence=half)).grade == "good"
    half = replace(half, shape=turned * [[1.0], [1.0], [factor]])
    said = verdict(course([0.001] * 50), replace(solid, evidence=half))
    assert said.grade == grade
    assert "how deep it is is a guess" in said.reason
    distant = verdict(course([0.001] * 50), replace(solid, camera=Camera(), evidence=half))
    assert (distant.grade == "good") is (factor == -1.0)  # without perspective its mirror image is as good


def test_what_a_solid_hides_of_itself_is_not_held_against_it() -> None:
    """Forty points around it, of which each keyframe shows the nearest sixteen."""
    around, views = np.arange(40) * 9.0, np.arange(60) * 6.0
    near = np.abs((around - views[:, None] + 180.0) % 360.0 - 180.0) < 70.0
    turning, share = shown(near), float(near.mean())
    assert 0.35 < share < 0.42
    assert verdict(course([0.001] * 50, share), turning).grade == "good"
    assert "near side" in verdict(course([0.001] * 50, 0.2), turning).reason
    some = shown(np.random.default_rng(0).random(near.shape) < share)
    assert verdict(course([0.001] * 50, share), some).grade == "fair"


def test_what_deforms_may_seem_to_turn() -> None:
    deforms = replace(SOLID, deformations=Deformations(np.eye(3), 0.01))
    noisy = replace(EVIDENCE, turn_degrees=14.0, solid=Misfit(1.0, 1.0))
    assert verdict(course([0.003] * 50), replace(SOLID, evidence=noisy)).grade == "fair"
    assert verdict(course([0.003] * 50), deforms).grade == "good"
    hardly = replace(EVIDENCE, turn_degrees=14.0)
    assert verdict(course([0.003] * 50), replace(SOLID, evidence=hardly)).grade == "good"
    said = verdict(course([0.003] * 50), replace(deforms, evidence=hardly))
    assert said.grade == "fair"
    assert "turned by 14° alone" in said.reason


@pytest.mark.parametrize(("flat_px", "grade"), [(0.6, "fair"), (0.8, "good")])
def test_a_solid_that_explains_hardly_more_than_a_plane(flat_px: float, grade: str) -> None:
    evidence = replace(EVIDENCE, flat=Misfit(flat_px, flat_px), turn_degrees=60.0)
    said = verdict(course([0.001] * 50), replace(SOLID, evidence=evidence))
    assert said.grade == grade
    assert ("a plane would leave hardly more" in said.reason) == (grade == "fair")


@pytest.mark.parametrize(
    ("turning", "turn_degrees", "grade"),
    [(0.6, 30.0, "good"), (0.85, 30.0, "fair"), (0.85, 150.0, "poor"), (0.99, 30.0, "poor")],
)
def test_changes_that_go_with_the_turn(turning: float, turn_degrees: float, grade: str) -> None:
    evidence = replace(EVIDENCE, turn_degrees=turn_degrees)
    said = verdict(
        course([0.001] * 50), replace(SOLID, evidence=evidence, deformations=Deformations(np.eye(3), 0.01, turning))
    )
    assert said.grade == grade
    assert (f"{turning:.0%} of its changes go with its turn" in said.reason) == (grade != "good")


@pytest.mark.parametrize(("otherwise", "grade"), [(0.07, "good"), (0.15, "poor")])
def test_shapes_far_off_that_would_be_as_likely(otherwise: float, grade: str) -> None:
    deformations = Deformations(np.eye(3), 0.01, otherwise=otherwise)
    said = verdict(course([0.001] * 50), replace(SOLID, deformations=deformations))
    assert said.grade == grade
    assert ("shapes that are 15% off would be about as likely" in said.reason) == (grade == "poor")


@pytest.mark.parametrize(("left_open", "grade"), [(0.03, "good"), (0.042, "fair"), (0.075, "poor")])
def test_what_its_views_leave_open(left_open: float, grade: str) -> None:
    deformations = Deformations(np.eye(3), 0.01, left_open=left_open)
    said = verdict(course([0.001] * 50), replace(SOLID, deformations=deformations))
    assert said.grade == grade
    assert (f"tell its shapes to {left_open:.1%} of its size only" in said.reason) == (grade != "good")


@pytest.mark.parametrize(("keyframes", "grade"), [(30, "good"), (60, "fair")])
def test_points_that_few_keyframes_show_have_no_place(keyframes: int, grade: str) -> None:
    seen = np.ones((keyframes, 27), bool)
    seen[4:, :2] = False  # four are an eighth of thirty, a fifteenth of sixty
    assert verdict(course([0.003] * 50), shown(seen)).grade == grade


@pytest.mark.parametrize(("share", "grade"), [(0.9, "good"), (0.4, "fair"), (0.2, "poor")])
def test_what_is_not_seen_is_a_guess(share: float, grade: str) -> None:
    assert verdict(course([0.003] * 50, share), SOLID).grade == grade


@pytest.mark.parametrize(("alike", "grade"), [(0.84, "good"), (0.73, "fair"), (0.5, "poor")])
def test_what_looks_otherwise_than_it_did_may_have_slid(alike: float, grade: str) -> None:
    said = verdict(course([0.003] * 50), SOLID, alike=alike)
    assert said.grade == grade
    assert (f"{1 - alike:.0%} of what is seen looks otherwise" in said.reason) == (grade != "good")


def test_points_that_do_not_move_with_the_rest() -> None:
    said = verdict(replace(course([0.003] * 50), seen=np.full(100, 50), far=np.repeat([25, 5], [5, 95])), SOLID)
    assert said.grade == "fair"
    assert "5% of the points do not move with it" in said.reason


def test_without_a_shape() -> None:
    assert verdict(Course(), None).grade == "poor"


def test_the_longest_stretch() -> None:
    assert longest(np.array([True, False, True, True, False])) == (2, 2)
    assert longest(np.zeros(3, bool)) == (0, 0)


def test_hardly_any_bits() -> None:
    said = verdict(course([0.003] * 50), SOLID, 0.005)
    assert said.grade == "poor"
    assert "0.005 bits a pixel" in said.reason


@pytest.mark.parametrize(("sureness", "grade"), [(5.0, "poor"), (1.5, "fair")])
def test_what_it_was_told_to_be_and_is_not(sureness: float, grade: str) -> None:
    said = verdict(course([0.003] * 50), replace(SOLID, evidence=replace(EVIDENCE, kind="sheet", sureness=sureness)))
    assert said.grade == grade
    assert "it is a sheet, not a solid" in said.reason


def test_points_of_a_solid_that_hardly_any_keyframe_shows() -> None:
    seen = np.ones((30, REST.motion.shape.shape[1]), bool)
    seen[2:, :1] = False
    assert verdict(course([0.001] * 50), shown(np.tile(seen, 2)[:, :50])).grade == "fair"
    seen[2] = True
    assert verdict(course([0.001] * 50), shown(seen)).grade == "good"
