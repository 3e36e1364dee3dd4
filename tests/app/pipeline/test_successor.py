"""After a cut to something else: it is followed in its own right, unless the object comes back, or nothing moves."""

import json
from dataclasses import replace
from functools import partial
from itertools import count
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.commands.retexture import retexture
from app.options.model import Model
from app.options.retexture import Retexture
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.pipeline.stages.messages import Begun, Footage, Seen
from app.pipeline.stages.tracking import first_points
from app.pipeline.stages.working_copy import WorkingCopy
from app.pipeline.stopwatch import Stopwatch
from app.pipeline.successor import AFTER_CUT_S, Successor, options_for_another
from app.playback.playback import Playback
from app.terminal.progress import Progress
from reconstruction.mapping.mapper import FIRST_LATENCY
from reconstruction.mapping.start import at_once
from tests.app.command_line import Command, grain, in_own_process, turning
from tests.app.scenes import FAST, GOOD, RED, another, run, scenes
from tests.synthetic_run import verify
from tests.tracking.region.test_search import scene
from tests.tracking.scene import SIZE, texture
from tracking import TrackingError
from tracking.guarded import Guarded, GuardedTracker
from tracking.video import Video

CUT, FRAMES = 30, 130
WAIT, SOON = round(30 * AFTER_CUT_S), 15
SOUGHT = 15  # frames in which it is looked for, at most
FIRST = 20 + int(FIRST_LATENCY * 20)  # frames until there is a model


@pytest.fixture(scope="module")
def two_scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One sheet, and after a cut another one."""
    return scenes(tmp_path_factory.mktemp("scenes") / "scenes.mp4", turning(CUT), another(FRAMES - CUT))


@pytest.fixture(scope="module")
def film(two_scenes: Path) -> Path:
    """A folder with the results of a run over them, and its words on the terminal."""
    files = ("--tracks-out", "tracks.npz", "--shapes-out", "shapes.npz")
    done = in_own_process(two_scenes.parent, "run", two_scenes, "--out", "film.rrd", "--json", *files, *GOOD)
    assert done.code == 0, done.err
    (two_scenes.parent / "out.json").write_text(done.out)
    (two_scenes.parent / "err.txt").write_text(done.err)
    return two_scenes.parent


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another object after a fraction of the time."""
    monkeypatch.setattr("app.pipeline.successor.AFTER_CUT_S", SOON / 30)
    monkeypatch.setattr("app.pipeline.successor.AGAIN_S", SOON / 30)


@pytest.fixture(autouse=True)
def in_folder(here: Path) -> None:
    """Recordings go to a folder of their own."""


def test_another_object_gets_a_part_with_a_model_of_its_own(film: Path) -> None:
    words = json.loads((film / "out.json").read_text())
    assert (words["frames"], words["objects"], words["losses"], words["recoveries"]) == (FRAMES, 2, 1, 0)
    assert (words["parts"], words["last_part"]) == (2, "film-part2.rrd")

    first, second = (Playback.load(film / name) for name in ("film.rrd", "film-part2.rrd"))
    begun = int(second.frames[0])
    assert CUT + WAIT + FIRST <= begun <= CUT + WAIT + FIRST + SOUGHT
    assert [*first.frames, *second.frames] == list(range(FRAMES))
    assert first.shaped.tolist() == [frame < CUT for frame in range(begun)]
    assert set(first.phases[CUT:]) == {"lost"}
    assert second.shaped.all()
    assert set(second.phases) == {"tracking"}
    text = f"another object from frame {begun} on: followed since frame"
    for playback in (first, second):
        assert [(frame, level) for frame, _, level, said in playback.events if text in said] == [(begun, "WARN")]
        verify(playback.path)
    assert (film / "err.txt").read_text().count(text) == 1
    assert first.summary is not None
    assert second.summary is not None
    assert first.summary["rest_shape_note"] == words["rest_shape_note"]
    assert second.summary["reprojection_rms_px"] < 0.5

    for name, frames in (("", range(begun)), ("-object2", range(begun - FIRST, FRAMES))):
        with np.load(film / f"shapes{name}.npz") as shapes, np.load(film / f"tracks{name}.npz") as tracks:
            assert shapes["frames"].tolist() == list(frames)
            assert len(tracks["W"]) == len(frames)


@pytest.mark.parametrize(
    "command",
    [
        "review film-part2.rrd",
        "review film.rrd film-part2.rrd",
        "retexture film-part2.rrd --texture red.png --out o.mp4",
        "export film-part2.rrd --format glb --out o.glb",
        "export film-part2.rrd --format mp4 --out o.mp4",
        "modes film-part2.rrd --out o.png",
        "evaluate tracks-object2.npz --rest-shape plane --modes 5",
    ],
)
def test_a_part_is_as_good_as_any_recording(modeshape: Command, film: Path, command: str) -> None:
    cv2.imwrite("red.png", RED)
    done = modeshape(*(film / word if (film / word).is_file() else word for word in command.split()))
    assert done.code == 0, done.err


def test_an_object_that_comes_back_in_time_keeps_its_model(tmp_path: Path) -> None:
    video = scenes(tmp_path / "v.mp4", turning(45), another(WAIT + 20), turning(20))
    words = run(video, bootstrap_frames=40)
    assert (words["objects"], words["losses"], words["recoveries"]) == (1, 1, 1)
    assert "parts" not in words
    playback = Playback.load(Path("run.rrd"))
    assert playback.shaped[-15:].all()
    assert playback.frames.tolist() == list(range(45 + WAIT + 40))


@pytest.mark.usefixtures("impatient")
def test_what_stands_still_is_no_object(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    words = run(scenes(tmp_path / "v.mp4", turning(10), (grain(texture(5), rng) for _ in range(60))))
    assert (words["objects"], words["frames_lost"]) == (1, 60)


@pytest.mark.usefixtures("impatient")
def test_of_another_scene_only_what_moves_is_followed(tmp_path: Path) -> None:
    after = [frame.image for frame in scene((90, 60, 130, 110, 25.0), frames=90)]
    words = run(scenes(tmp_path / "v.mp4", turning(10), after), bootstrap_frames=10, tracks_out=Path("t.npz"))
    assert words["objects"] == 2
    with np.load("t-object2.npz") as tracks:
        x, y = tracks["W"][0]
    inside = (x > 90 - 30) & (x < 220 + 30) & (y > 60 - 5) & (y < 170 + 5)
    assert inside.mean() > 0.95


@pytest.mark.usefixtures("impatient")
def test_without_corners_it_is_tried_again(tmp_path: Path) -> None:
    white = [np.full((*SIZE[::-1], 3), 255, np.uint8)] * (SOON + 10)
    words = run(scenes(tmp_path / "v.mp4", turning(10), white, another(40)))
    assert words["objects"] == 2
    assert Playback.load(Path("run-part2.rrd")).frames[0] <= 10 + SOON + 10 + SOON + 15


@pytest.mark.usefixtures("impatient")
def test_one_that_gives_no_rest_shape_costs_nothing(tmp_path: Path) -> None:
    moved = (np.roll(texture(5), shift, axis=1) for shift in range(60))
    words = run(scenes(tmp_path / "v.mp4", turning(15), moved), rest_shape="rigid", bootstrap_frames=10)
    assert (words["objects"], words["rest_shape"]) == (1, "rigid")
    assert Playback.load(Path("run.rrd")).shaped.sum() == 15


@pytest.mark.usefixtures("impatient")
def test_an_object_lost_early_has_the_model_of_the_frames_there_were(tmp_path: Path) -> None:
    words = run(scenes(tmp_path / "v.mp4", turning(8), another(50)), bootstrap_frames=10)
    assert (words["objects"], words["bootstrap_frames"]) == (2, 8)
    assert Playback.load(Path("run.rrd")).shaped.sum() == 8
    assert Playback.load(Path("run-part2.rrd")).shaped.all()


def test_frames_of_both_are_given_in_order(two_scenes: Path) -> None:
    config = Run(str(two_scenes), points=100, rest_shape="plane", model=Model(modes=5, bootstrap_frames=5))
    processed = list(Session(config, Progress(), record=False).frames())
    surfaces = list(dict.fromkeys(one.surface for one in processed))
    assert [surface.first.index >= CUT + WAIT for surface in surfaces if surface] == [False, True]
    begun = [one.surface for one in processed].index(surfaces[1])
    assert [one.frame.index for one in processed] == list(range(FRAMES))
    assert [one.estimate is not None for one in processed] == [not CUT <= index < begun for index in range(FRAMES)]
    for one in processed:
        assert one.estimate is None or len(one.estimate.visible) == len(one.observation.visible)


def test_a_picture_stays_on_the_object_it_was_put_on(two_scenes: Path) -> None:
    cv2.imwrite("red.png", RED)
    model = Model(modes=5, bootstrap_frames=5)
    command = Retexture(
        source=str(two_scenes), texture=Path("red.png"), out=Path("o.mp4"), points=100, rest_shape="plane", model=model
    )
    painted = retexture(command, Progress())
    assert (painted.on.as_dict()["objects"], painted.painted_frames) == (2, CUT)
    with Video("o.mp4") as video:
        assert sum(1 for _ in video) == FRAMES


@pytest.mark.slow
def test_a_batch_keeps_the_parts(modeshape: Command, two_scenes: Path, here: Path) -> None:
    done = modeshape("batch", two_scenes, "--out", "out", "--json", f"--options={' '.join(map(str, FAST))} --image none")
    assert done.code == 0, done.err
    assert json.loads(done.out)["videos"][0]["last_part"] == str(here / "out" / "scenes-part2.rrd")
    assert sorted(path.name for path in Path("out").glob("*.rrd")) == ["scenes-part2.rrd", "scenes.rrd"]
    assert not Path("out", "unfinished").exists()


@pytest.mark.parametrize(("cut", "wait_s"), [(True, 2.0), (False, 10.0)])
def test_what_is_covered_has_longer_than_what_was_cut(cut: bool, wait_s: float) -> None:
    config = Run("video.mp4", points=100, rest_shape="plane", model=Model(modes=5, bootstrap_frames=5))
    pictures = list(another(60))
    lost = Seen(0, 0, 100.0, 0.0, {}, (), {})
    successor = Successor(config, lost, count(1), Stopwatch(), at_once, cut=cut)
    trackers: dict[int, GuardedTracker] = {}
    whole = np.full(pictures[0].shape[:2], 255, np.uint8)
    for index, picture in enumerate(pictures):
        objects: dict[int, Begun | Guarded | TrackingError] = {}
        for one, expected_px in successor.expected_px.items():
            if one in trackers:
                objects[one] = trackers[one].track(picture, expected_px)
            else:
                objects[one] = begun = Begun(first_points(Footage.of(config), picture, whole, WorkingCopy(SIZE)))
                trackers[one] = GuardedTracker(picture, begun.points_px)
        seen = replace(lost, index=index, time_s=100.0 + wait_s - 1.0 + index / 30, objects=objects)
        successor.look(seen, partial(np.copy, picture))
        if successor.found:
            break
    assert successor.found is not None
    assert successor.found.first.index == 31  # one after it was asked for


def test_what_was_said_of_the_first_object_does_not_go_for_another() -> None:
    output = Output(tracks_out=Path("a/t.npz"), image="video")
    config = Run(
        "v.mp4", rest_shape="m.obj", ground_truth=Path("g.npz"), texture=Path("t.png"), roi=(1, 2, 3, 4), output=output
    )
    other = options_for_another(config, 3)
    assert (other.rest_shape, other.ground_truth, other.texture, other.roi) == ("auto", None, None, (1, 2, 3, 4))
    assert other.output == Output(tracks_out=Path("a/t-object3.npz"), image="video")
