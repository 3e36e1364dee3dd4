import time
from pathlib import Path

import numpy as np
import pytest

from app.recording.recording import Recording
from app.recording.styles import PREDICTED_RGB, SEEN_RGB
from tests.synthetic_run import CORNERS_BGR, SIZE, Run, verify, write_run
from tests.viewer.conftest import Viewer
from tests.viewer.screenshot import SETTLE_S, shot
from tracking.video import Frame

pytestmark = pytest.mark.viewer

FRAMES = 40


@pytest.fixture(scope="module")
def run(viewer: Viewer, tmp_path_factory: pytest.TempPathFactory) -> Run:
    run = write_run(tmp_path_factory.mktemp("viewer") / "sheet.rrd", frames=FRAMES, unsure=False)
    viewer.client.open(str(run.path))
    end = time.monotonic() + SETTLE_S
    while viewer.client.get_state().loading and time.monotonic() < end:
        time.sleep(0.1)
    return run


@pytest.mark.usefixtures("run")
def test_the_blueprint_opens_healthy(viewer: Viewer) -> None:
    shot(viewer, "Mesh", 30)
    views = viewer.client.get_state().views
    assert {view.name.split(":")[0]: view.view_class for view in views} == {
        "Mesh, from where the camera is": "3D",
        "From the side": "3D",
        "Video": "2D",
        "What you see": "TextDocument",
        "Reprojection error, px": "TimeSeries",
        "Share of points seen": "TimeSeries",
        "How it deforms": "TimeSeries",
        "This frame, by mode": "BarChart",
        "Milliseconds per stage": "TimeSeries",
        "Events": "TextLog",
        "Modes": "3D",
        "Configuration": "TextDocument",
        "Summary": "TextDocument",
    }
    assert [view.reports for view in views if view.reports] == []
    [recording] = viewer.client.get_state().recordings
    assert {line.name: (line.start, line.end) for line in recording.timelines}["frame"] == (0, FRAMES - 1)
    assert recording.current_timeline == "frame"


@pytest.mark.usefixtures("run")
def test_the_mesh_is_there_textured_and_upright(viewer: Viewer) -> None:
    picture = shot(viewer, "Mesh", 0)
    background = picture[len(picture) // 2, 5].astype(int)
    mesh = np.abs(picture.astype(int) - background).max(axis=2) > 30
    assert 0.1 < mesh.mean() < 0.9
    # The sheet's quarters, seen from the camera: red, green above blue, yellow.
    rows, columns = np.nonzero(mesh)
    y, x = rows.mean(), columns.mean()
    dy, dx = 0.9 * rows.std(), 0.9 * columns.std()
    for color, (down, right) in zip(CORNERS_BGR, ((-1, -1), (-1, 1), (1, -1), (1, 1)), strict=True):
        pixel = picture[int(y + down * dy), int(x + right * dx)].astype(int)
        assert np.abs(pixel - color).max() <= 12, f"{pixel} instead of {color}"


def test_the_overlay_sits_on_the_video(viewer: Viewer, run: Run) -> None:
    frame = 31
    picture = shot(viewer, "Video", frame).astype(int)
    # The sheet covers pixels 30 to 129 and 20 to 99; their centres are at whole numbers, so its edges at .5.
    sheet = (picture < 140).any(axis=2) & (np.abs(picture - [32, 26, 24]).max(axis=2) > 20)
    left, right = np.flatnonzero(sheet.sum(axis=0) > 0.5 * sheet.sum(axis=0).max())[[0, -1]] + [0, 1]
    top, bottom = np.flatnonzero(sheet.sum(axis=1) > 0.5 * sheet.sum(axis=1).max())[[0, -1]] + [0, 1]
    scale = np.array([right - left, bottom - top]) / [100.0, 80.0]
    assert scale[0] == pytest.approx(scale[1], rel=0.02)
    origin = np.array([left, top]) - scale * [29.5, 19.5]

    seen = run.observations[frame].visible
    for points, color in (
        (run.observations[frame].points_px[seen], SEEN_RGB),
        (run.estimates[frame].projection_px[~seen], PREDICTED_RGB),
    ):
        offsets = []
        for place in origin + scale * points:
            x, y = np.floor(place).astype(int)
            around = picture[y - 4 : y + 5, x - 4 : x + 5]
            rows, columns = np.nonzero(np.abs(around - color[::-1]).max(axis=2) <= 60)
            if len(rows):
                offsets.append([x - 3.5 + columns.mean(), y - 3.5 + rows.mean()] - place)
        assert len(offsets) > 0.7 * len(points)
        assert np.abs(np.median(offsets, axis=0)).max() < 1.0, "half a pixel of the video is about 2 on the screen"


@pytest.mark.usefixtures("run")
def test_time_moves(viewer: Viewer) -> None:
    for name in ("Mesh", "Video"):
        first, later = shot(viewer, name, 0), shot(viewer, name, 30)
        assert (np.abs(first.astype(int) - later).max(axis=2) > 30).mean() > 0.005, name


def test_a_run_streams_to_file_and_viewer_and_survives_its_end(mortal_viewer: Viewer, run: Run, tmp_path: Path) -> None:
    path = tmp_path / "live.rrd"
    with Recording(path, configuration={}, size=SIZE, connect=mortal_viewer.address) as recording:
        for index in range(5):
            recording.observe(Frame(index, index / 30, run.picture), run.observations[index], phase="bootstrap")
        end = time.monotonic() + SETTLE_S
        while not mortal_viewer.client.get_state().recordings and time.monotonic() < end:
            time.sleep(0.1)
        assert len(mortal_viewer.client.get_state().recordings) == 1
        mortal_viewer.process.kill()
        mortal_viewer.process.wait()
        for index in range(5, 10):
            recording.observe(Frame(index, index / 30, run.picture), run.observations[index], phase="bootstrap")
    verify(path)
    assert path.stat().st_size > 10 * 2000
