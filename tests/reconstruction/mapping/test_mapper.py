"""When models are made, and from which frame on they are in force."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from reconstruction.arrays import Array
from reconstruction.basis.rest_shape import RestShape, RigidMotion
from reconstruction.camera import Camera, quaternion_exp, rotation_from_quaternion
from reconstruction.mapping import mapper
from reconstruction.mapping.keyframes import KEYFRAMES
from reconstruction.mapping.map import Map
from reconstruction.mapping.mapper import FEW, FEWEST, FIRST_LATENCY, LATENCY, MORE, RENEWED, Mapper, nearest_first
from reconstruction.mapping.start import at_once
from reconstruction.settings import FIRST_LOOKS, Settings

POINTS = 20
CAMERA = Camera(500.0, np.zeros(2))
SHAPE = np.random.default_rng(0).normal(size=(3, POINTS))


def model(poses: int) -> Map:
    motion = RigidMotion(SHAPE, np.stack([np.eye(3)] * poses), np.arange(1.0, poses + 1), np.zeros((poses, 2)))
    return Map(RestShape("rigid", motion, ""), CAMERA)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Models that say how many frames they are of."""
    monkeypatch.setattr(mapper, "bootstrap", lambda W, *others: model(len(W)) if others[-1] else None)
    monkeypatch.setattr(mapper, "map_of", lambda W, *_, last=None: model(len(last()[0] if last else W)))
    monkeypatch.setattr(mapper, "first_sight", lambda *_: None)


class Later:
    """Calls that are answered when they are told to be."""

    def __init__(self) -> None:
        self.begun: list[tuple[Future[object], Callable[..., object], tuple[object, ...]]] = []

    def __call__(self, function: Callable[..., object], *arguments: object) -> "Future[object]":
        self.begun.append((Future(), function, arguments))
        return self.begun[-1][0]

    def answer(self) -> None:
        future, function, arguments = self.begun.pop(0)
        future.set_result(function(*arguments))


def image(frame: int) -> np.ndarray:
    """Wider and wider."""
    return SHAPE[:2] * [[1 + 0.01 * frame], [1.0]]


def adopted(used: Mapper, frames: range) -> list[int]:
    """The frames from which on another model is in force."""
    seen = np.ones(POINTS, bool)
    return [f for f in frames if used.add(image(f), seen, CAMERA, (image(f), seen)) is not None]


def test_the_last_of_the_first_looks_decides() -> None:
    used = Mapper(Settings(revise=False))
    assert adopted(used, range(200)) == [FIRST_LOOKS[-1] - 1]
    assert used.first_frames == FIRST_LOOKS[-1]
    assert used.final(CAMERA, []) is None


def test_maps_made_elsewhere_are_in_force_after_a_fixed_number_of_frames() -> None:
    later = Later()

    def soon(function: Callable[..., object], *arguments: object) -> "Future[object]":
        future = later(function, *arguments)
        later.answer()
        return future

    first = FIRST_LOOKS[-1] - 1
    used = Mapper(Settings(), soon, latency=LATENCY)
    assert adopted(used, range(first + LATENCY + 2))[:2] == [first + int(FIRST_LATENCY * (first + 1)), first + LATENCY]


def test_live_ones_are_in_force_as_soon_as_they_are_there() -> None:
    later = Later()
    used = Mapper(Settings(revise=False), later, live=True)
    assert adopted(used, range(80)) == []
    assert len(later.begun) == 1
    later.answer()  # with nothing: there were too few frames
    assert adopted(used, range(80, 90)) == []
    later.answer()
    assert adopted(used, range(90, 100)) == [90]
    assert used.first_frames == 82


@pytest.mark.parametrize(
    ("latency", "sheet", "poses"),
    [(0, True, KEYFRAMES), (LATENCY, True, FEW + 1), (LATENCY, False, FIRST_LOOKS[-1])],
    ids=["of all keyframes", "a sheet by a few where frames come meanwhile", "a guess where they are none"],
)
def test_the_first_model(latency: int, sheet: bool, poses: int, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = np.ones(POINTS, bool)

    def by_keyframes(W: Array, *_: object) -> Map:
        return replace(model(len(W)), seen=np.ones((len(W), POINTS), bool))

    monkeypatch.setattr(mapper, "map_of", by_keyframes)
    monkeypatch.setattr(
        mapper, "first_sight", lambda W, *_: by_keyframes(W) if sheet and (W[0] == image(0)).all() else None
    )
    used = Mapper(Settings(), at_once, latency=latency)
    found = [used.add(image(f), seen, CAMERA, (image(0), seen)) for f in range(FIRST_LOOKS[-1] + 20)]
    first = next(one for one in found if one is not None)
    assert len(first.rest.motion.s) == poses
    assert (first.seen is None) == (poses == FIRST_LOOKS[-1])


def test_where_keyframes_do_not_tell_it_begins_with_a_guess(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mapper, "map_of", lambda *_: None)
    assert adopted(Mapper(Settings()), range(100)) == [FIRST_LOOKS[-1] - 1]


def test_frames_are_read_once_more_for_a_solid_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def frames() -> Iterator[tuple[np.ndarray, np.ndarray]]:
        raise AssertionError("read")
        yield

    flat = replace(model(1), rest=replace(model(1).rest, kind="plane"))
    monkeypatch.setattr(mapper, "map_of", lambda *_, **__: flat)
    used = Mapper(Settings())
    adopted(used, range(20))
    assert used.final(CAMERA, frames()) is not None


def test_another_look_when_the_views_have_grown() -> None:
    versions: list[int] = []
    used = Mapper(Settings())
    seen = np.ones(POINTS, bool)
    for f in range(300):
        before = used._version
        used.add(image(f), seen, CAMERA, (image(f), seen))
        if used._version != before:
            versions.append(used._version)
    assert versions[0] >= FEWEST
    assert 3 < len(versions) < 20
    still = Mapper(Settings())
    looks = [still.add(image(0), seen, CAMERA, (image(0), seen)) is not None for _ in range(300)]
    assert sum(looks) <= 2  # nothing new comes


def test_posed_first_as_where_it_begins() -> None:
    turned = rotation_from_quaternion(quaternion_exp(np.array([[0.0, angle, 0.0] for angle in (0.8, 0.4, 0.0)])))
    motion = RigidMotion(SHAPE, turned, np.full(3, 30.0), np.zeros((3, 2)))
    found = Map(RestShape("rigid", motion, ""), CAMERA)
    seen = 30.0 * turned[1] @ SHAPE
    W = seen[:2] / (1 + seen[2] / CAMERA.focal_px) + [[7.0], [0.0]]  # a shift does not matter
    visible = np.arange(POINTS) > 3
    np.testing.assert_array_equal(nearest_first(found, np.where(visible, W, np.nan), visible).rest.motion.R[0], turned[1])


def test_the_final_map_is_of_more_keyframes() -> None:
    used = Mapper(Settings())
    frames = range(MORE * KEYFRAMES + 1)
    adopted(used, frames)
    found = used.final(CAMERA, ((image(f), np.ones(POINTS, bool)) for f in frames))
    assert found is not None
    assert len(found.rest.motion.s) == MORE * KEYFRAMES


@pytest.mark.parametrize("latency", [0, LATENCY])
@pytest.mark.parametrize("told", [True, False])
def test_what_ends_early_has_the_map_of_all_its_keyframes(
    latency: int,
    told: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Once made, it is the final one, too; and a guess if keyframes do not tell."""
    made: list[int] = []

    def once(W: np.ndarray, *_: object, last: object = None) -> Map | None:
        made.append(len(W))
        flat = replace(model(len(W)).rest, kind="plane")
        return replace(model(len(W)), rest=flat, seen=np.ones((len(W), POINTS), bool)) if told and last else None

    monkeypatch.setattr(mapper, "map_of", once)
    used, frames = Mapper(Settings(), at_once, latency=latency), FIRST_LOOKS[-1] - 5
    assert adopted(used, range(frames)) == []
    found = used.finish(CAMERA)
    assert found is not None
    assert (found.seen is not None) == told
    assert used.finish(CAMERA) is None
    if told:
        assert used.final(CAMERA, []) is not None
        assert made == [KEYFRAMES]


def test_what_goes_wrong_is_raised_with_the_result() -> None:
    def fails() -> None:
        raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        at_once(fails).result()
    assert RENEWED > 1
