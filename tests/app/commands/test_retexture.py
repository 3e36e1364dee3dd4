"""`modeshape retexture`: recordings and videos with a picture painted on the surface."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.commands.retexture import first_frame, is_recording, retexture
from app.options.retexture import Retexture
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.terminal.errors import UsageError
from app.terminal.progress import Progress
from tests.app.card import card
from tests.app.command_line import Command, still, turning, write_video
from tests.synthetic_run import SIZE, picture, write_run
from tracking.video import Video

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]


@pytest.fixture
def texture(tmp_path: Path) -> Path:
    path = tmp_path / "card.png"
    cv2.imwrite(str(path), card())
    return path


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    """A small recording without noise."""
    return write_run(tmp_path / "sheet.rrd").path


def frames_of(path: Path) -> list[Image]:
    with Video(str(path)) as video:
        return [frame.image for frame in video]


def command(source: object, texture: Path, out: Path, **options: object) -> Retexture:
    return Retexture(source=str(source), texture=texture, out=out, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("ending", [".mp4", ".webm"])
def test_a_recording_is_enough(tmp_path: Path, sheet: Path, ending: str) -> None:
    texture, out = tmp_path / "red.png", tmp_path / f"new{ending}"
    cv2.imwrite(str(texture), np.full((20, 30, 3), (20, 20, 240), np.uint8))
    painted = retexture(command(sheet, texture, out), Progress())
    assert painted.on.frames == painted.painted_frames == 6
    frames = frames_of(out)
    assert len(frames) == 6
    assert frames[0].shape == (SIZE[1], SIZE[0], 3)
    inside, outside = frames[0][40:80, 50:110].astype(int), frames[0][:15].astype(int)
    assert (inside[..., 2] - inside[..., 0]).min() > 60
    assert np.abs(outside - picture()[:15]).max() < 12
    assert not list(tmp_path.glob("*.part*"))


def test_a_place_by_four_corners_of_another_frame(tmp_path: Path, sheet: Path) -> None:
    texture, out = tmp_path / "red.png", tmp_path / "new.mp4"
    cv2.imwrite(str(texture), np.full((20, 30, 3), (20, 20, 240), np.uint8))
    corners = (70.0, 50.0, 100.0, 46.0, 104.0, 70.0, 68.0, 74.0)
    retexture(command(sheet, texture, out, place=corners, place_frame=5), Progress())
    retexture(command(sheet, texture, tmp_path / "bare.mp4", opacity=0.0), Progress())
    painted, bare = frames_of(out)[5].astype(int), frames_of(tmp_path / "bare.mp4")[5].astype(int)
    red = np.abs(painted - bare).max(axis=-1) > 40
    wanted = cv2.fillConvexPoly(np.zeros(red.shape, np.uint8), np.reshape(corners, (4, 2)).astype(np.int32), 1) > 0
    assert (red & wanted).sum() / (red | wanted).sum() > 0.85


def test_a_video_is_painted_as_its_recording_is(tmp_path: Path, videos: Path, texture: Path) -> None:
    out, rrd = tmp_path / "live.mp4", tmp_path / "live.rrd"
    run = command(videos / "turning.mp4", texture, out, points=120, rrd=rrd)
    painted = retexture(run, Progress())
    assert painted.on.frames == painted.painted_frames == 40
    live = frames_of(out)
    assert len(live) == 40
    again = tmp_path / "again.mp4"
    retexture(command(rrd, texture, again), Progress())
    assert np.mean([np.abs(a.astype(int) - b).mean() for a, b in zip(live, frames_of(again), strict=True)]) < 3


def test_without_its_name_no_recording_is_left(here: Path, videos: Path, texture: Path) -> None:
    retexture(command(videos / "turning.mp4", texture, here / "live.mp4", points=120, frames=":12"), Progress())
    assert [path.name for path in here.iterdir()] == ["live.mp4"]


def test_the_first_frame_is_found_in_a_later_part(tmp_path: Path) -> None:
    playback = Playback.load(write_run(tmp_path / "sheet.rrd").path)
    elsewhere = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
    seen = first_frame(playback, 0, elsewhere)
    assert seen.shape == elsewhere.shape
    assert np.array_equal(seen[30:90, 40:120], picture()[30:90, 40:120])
    painted = replace(playback, configuration={"texture": "card.png"})
    assert first_frame(painted, 0, elsewhere) is elsewhere
    with pytest.raises(UsageError, match="give the first part of the recording"):
        first_frame(replace(painted, W=painted.W + 20), 0, elsewhere)


def test_run_with_a_texture_paints_the_recording(tmp_path: Path, videos: Path, texture: Path) -> None:
    shown = {}
    for name, options in (("plain", {}), ("painted", {"texture": texture, "opacity": 1.0})):
        path = tmp_path / f"{name}.rrd"
        run = Run(str(videos / "turning.mp4"), points=120, frames=":12", output=Output(out=path), **options)  # type: ignore[arg-type]
        Session(run, Progress()).run()
        shown[name] = Playback.load(path)
    before, after = shown["plain"].texture_bgr.astype(int), shown["painted"].texture_bgr.astype(int)
    assert np.abs(before - after).mean() > 30
    x, y = shown["painted"].texture_origin
    first = next(image for _, image in shown["painted"].images())
    assert first is not None
    h, w = before.shape[:2]
    assert np.abs(first[y : y + h, x : x + w].astype(int) - before).mean() < 4  # the frame itself stays what it was


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"texture": Path("missing.png")}, r"no texture missing\.png"),
        ({"texture": Path("text.png")}, r"texture text\.png is not a picture"),
        ({"texture": Path("text.mov")}, r"texture text\.mov is no picture and no video"),
        ({"out": Path("new.avi")}, r"videos are written as \.mp4 or \.webm"),
        ({"out": Path("old.mp4")}, r"old\.mp4 exists: replace it with --overwrite"),
        ({"out": Path("text.png/new.mp4")}, r"cannot write text\.png/new\.mp4"),
        ({"source": "missing.rrd"}, r"missing\.rrd"),
        ({"source": "text.rrd"}, r"text\.rrd"),
        ({"source": "missing.mp4"}, r"no video file missing\.mp4"),
        ({"roi": (1, 2, 30, 40)}, r"--roi is for videos"),
        ({"rrd": Path("x.rrd")}, r"--rrd is for videos"),
        ({"place": (0, 0, 5, 5)}, r"--place is not on the surface"),
        ({"place_frame": 3}, r"--place-frame goes with --place"),
        ({"place": (60, 40, 30, 30), "place_frame": 77}, r"--place-frame 77: there is no shape in that frame"),
        ({"frames": "90:99"}, r"no frame in 90:99"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_mistakes_are_named(here: Path, sheet: Path, texture: Path, change: dict[str, object], complaint: str) -> None:
    for name in ("text.png", "text.mov", "text.rrd", "old.mp4"):
        (here / name).write_text("words\n" * 99)
    asked = {"source": str(sheet), "texture": texture, "out": Path("new.mp4")} | change
    with pytest.raises(ValueError, match=complaint):
        retexture(Retexture(**asked), Progress())  # type: ignore[arg-type]
    assert not (here / "new.mp4").exists()
    assert (here / "old.mp4").read_text().startswith("words")


@pytest.mark.parametrize(
    ("place", "opacity"),
    [((1, 2, 0, 9), 1.0), ((1, 2, 9, -1), 1.0), ((1, 1, 9, 9, 9, 1, 1, 9), 1.0), (None, 1.5), (None, -0.1)],
)
def test_options_that_mean_nothing(place: tuple[float, ...] | None, opacity: float) -> None:
    with pytest.raises(UsageError, match=r"--place|--opacity"):
        command("a.rrd", Path("b.png"), Path("c.mp4"), place=place, opacity=opacity)


def test_a_recording_without_pictures_is_refused(tmp_path: Path, texture: Path) -> None:
    run = write_run(tmp_path / "blind.rrd", image="none")
    with pytest.raises(UsageError, match=r"no pictures: run again with --image"):
        retexture(command(run.path, texture, tmp_path / "new.mp4"), Progress())


def test_a_codec_that_is_not_there(tmp_path: Path, sheet: Path, texture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.files.video_out.CODECS", {".mp4": "XXXX", ".webm": "XXXX"})
    with pytest.raises(UsageError, match=r"this PyAV has no XXXX encoder"):
        retexture(command(sheet, texture, tmp_path / "new.webm"), Progress())
    assert not list(tmp_path.glob("new*"))


def test_the_command_line(modeshape: Command, here: Path, sheet: Path, texture: Path) -> None:
    done = modeshape("retexture", sheet, "--texture", texture, "--out", "new.mp4", "--opacity", 0.8, "--json")
    assert done.code == 0
    assert json.loads(done.out)["painted_frames"] == 6
    assert (here / "new.mp4").stat().st_size > 0
    done = modeshape("retexture", sheet, "--texture", texture, "--out", "new.mp4")
    assert (done.code, done.err.count("\n")) == (2, 1)


@pytest.mark.parametrize(
    ("name", "content", "found"), [("a.rrd", b"", True), ("b", b"RRF2abc", True), ("c", b"abc", False)]
)
def test_recordings_are_recognised(tmp_path: Path, name: str, content: bytes, found: bool) -> None:
    (tmp_path / name).write_bytes(content)
    assert is_recording(str(tmp_path / name)) is found
    assert not is_recording("0")


def test_a_video_that_begins_black_is_painted_from_where_its_recording_begins(tmp_path: Path, texture: Path) -> None:
    pictures = [*(0 * picture for picture in still(8)), *turning(20)]
    path, out = write_video(tmp_path / "late.mp4", pictures), tmp_path / "out.mp4"
    painted = retexture(command(path, texture, out, points=100), Progress())
    frames = frames_of(out)
    assert painted.painted_frames == len(frames) == 20
    assert min(float(frame.mean()) for frame in frames) > 20
