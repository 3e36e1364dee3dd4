"""Where a run begins."""

from collections import deque
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.pipeline.stages.first_look import first_look, keeping, pack, unpack
from app.pipeline.stages.messages import Asked, Begun, Footage
from app.pipeline.stages.tracking import TrackingStage
from app.terminal.errors import UsageError
from tests.tracking.region.test_search import scene
from tracking import TrackingError
from tracking.video import Frame, Video

Image = NDArray[np.uint8]
BLACK = 4
NOTHING: Image = np.zeros((240, 320, 3), np.uint8)


def unwanted(*_: object, **__: object) -> None:
    pytest.fail("opened again")


def write(path: Path, frames: Iterable[Image]) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (320, 240))
    for image in frames:
        writer.write(image)
    writer.release()
    return path


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A box that swings before a wall, after some black frames."""
    box = scene((90, 60, 130, 110, 25.0), frames=40)
    return write(tmp_path / "box.avi", [*[NOTHING] * BLACK, *(frame.image for frame in box)])


def test_the_surface_of_a_file_is_found_and_no_frame_from_there_on_is_missing(source: Path) -> None:
    with Video(str(source)) as video:
        look = first_look(Footage(str(source)), video)
        assert [frame.index for frame in look.frames] == list(range(BLACK, BLACK + 40))
    x, y, w, h = cv2.boundingRect(look.region)
    assert (abs(x - 90) < 12, abs(y - 60) < 12, abs(w - 130) < 24, abs(h - 110) < 24) == (True,) * 4
    blank, found = look.notes
    assert blank == f"the first {BLACK} frames show nothing to follow, or what is soon gone: begins with frame {BLACK}"
    assert f"--roi {x} {y} {w} {h}; choose by --roi X Y W H" in found


def test_of_a_live_source_too(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Video(str(source)) as video:
        video.live = True
        monkeypatch.setattr("app.pipeline.stages.first_look.Video", unwanted)
        look = first_look(Footage(str(source)), video)
        assert [frame.index for frame in look.frames] == list(range(BLACK, BLACK + 40))
    assert not look.region.all()


def test_without_a_search_the_region_is_as_given(source: Path) -> None:
    with Video(str(source)) as video:
        look = first_look(Footage(str(source), roi=(10, 20, 100, 90), search=False), video)
        assert next(look.frames).index == 0
    assert cv2.boundingRect(look.region) == (10, 20, 100, 90)
    assert look.notes == []


def test_a_still_scene_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "still.avi", (frame.image for frame in scene(frames=10)))
    with Video(str(path)) as video:
        look = first_look(Footage(str(path)), video)
    assert look.region.all()
    assert look.notes == ["no surface is seen to move in 10 frames: the whole region is taken; choose by --roi X Y W H"]


def test_no_more_of_a_live_source_is_kept_than_there_is_memory_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.pipeline.stages.first_look.MOST_BYTES", 5 * 240 * 320 * 3)
    kept = deque[Frame]()
    assert len(list(keeping(scene(), kept, ends=True))) == 6
    assert len(kept) == 6


def test_a_file_of_large_pictures_is_read_again(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.pipeline.stages.first_look.MOST_BYTES", 5 * 240 * 320 * 3)
    with Video(str(source)) as video:
        look = first_look(Footage(str(source)), video)
        assert [frame.index for frame in look.frames] == list(range(BLACK, BLACK + 40))


def test_nothing_to_follow_is_an_error(tmp_path: Path) -> None:
    path = write(tmp_path / "black.avi", [NOTHING] * 5)
    with Video(str(path)) as video, pytest.raises(TrackingError, match="corners"):
        first_look(Footage(str(path)), video)


@pytest.mark.parametrize(("size", "packed"), [((1920, 1080), True), ((1920, 1081), False), ((1280, 720), False)])
def test_large_pictures_are_kept_in_half_the_memory(size: tuple[int, int], packed: bool) -> None:
    rng = np.random.default_rng(0)
    image = cv2.resize(rng.integers(30, 225, (27, 48, 3)).astype(np.uint8), size, interpolation=cv2.INTER_CUBIC)
    kept = pack(image)
    assert kept.nbytes == image.nbytes / (2 if packed else 1)
    grays = [cv2.cvtColor(one, cv2.COLOR_BGR2GRAY).astype(int) for one in (image, unpack(kept))]
    assert np.abs(grays[0] - grays[1]).max() <= (3 if packed else 0)
    assert np.median(np.abs(unpack(kept).astype(int) - image)) <= (1 if packed else 0)


def test_a_mesh_of_the_first_object_says_nothing_of_the_next(source: Path, tmp_path: Path) -> None:
    mesh = tmp_path / "elsewhere.obj"
    mesh.write_text("v 0 0 0\nv 9 0 0\nv 0 9 0\nv 9 9 1\nf 1 2 3\nf 2 4 3\n")
    stage = TrackingStage(Footage(str(source), (BLACK, None), search=False, rest_shape=str(mesh)))
    with pytest.raises(UsageError, match="does not fit"):
        stage.next(Asked({0: None}), lambda *_: None)
    seen = stage.next(Asked({1: None}), lambda *_: None)
    assert seen is not None
    assert isinstance(seen.objects[1], Begun)
    stage.video.close()


def test_motion_in_full_hd_is_no_cut(shared_data: Path, tmp_path: Path) -> None:
    """The search follows points in pictures of half the width, or most would be lost."""
    large = tmp_path / "hd.avi"
    writer = cv2.VideoWriter(str(large), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (1920, 1440))
    with Video(str(shared_data / "kinect_paper.mp4"), stop=40) as video:
        for frame in video:
            writer.write(cv2.resize(frame.image, (1920, 1440), interpolation=cv2.INTER_CUBIC))
    writer.release()
    with Video(str(large)) as video:
        look = first_look(Footage(str(large)), video)
        assert next(look.frames).index == 0
        assert look.region.shape == (1440, 1920)
