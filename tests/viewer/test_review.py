import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.commands.review import review
from app.options.review import Review
from app.terminal.progress import Progress
from tests.synthetic_run import CORNERS_BGR, write_run
from tests.viewer.conftest import Viewer
from tests.viewer.screenshot import SETTLE_S, shot

pytestmark = pytest.mark.viewer

FRAMES = 40


def wait(until: Callable[[], bool]) -> None:
    end = time.monotonic() + SETTLE_S
    while not until() and time.monotonic() < end:
        time.sleep(0.1)
    assert until()


def test_view_uses_the_viewer_that_runs(mortal_viewer: Viewer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = write_run(tmp_path / "one.rrd")
    monkeypatch.setattr("app.recording.viewer.PORT", int(mortal_viewer.address.rsplit(":", 1)[1]))
    review(Review(run.path, view=True, json=True), Progress())
    wait(lambda: bool(mortal_viewer.client.get_state().recordings))
    [recording] = mortal_viewer.client.get_state().recordings
    assert [(line.start, line.end) for line in recording.timelines if line.name == "frame"] == [(0, 5)]


def shown(viewer: Viewer, *recordings: Path) -> set[str]:
    """Send recordings as the command does; names of the views that open."""
    review(Review(*recordings, connect=viewer.address, json=True), Progress())
    views = {"Mesh", "Video"}
    wait(lambda: all(any(view.name.startswith(name) for view in viewer.client.get_state().views) for name in views))
    wait(lambda: not viewer.client.get_state().loading)
    return {view.name for view in viewer.client.get_state().views}


def test_one_recording(mortal_viewer: Viewer, tmp_path: Path) -> None:
    run = write_run(tmp_path / "one.rrd", frames=FRAMES)
    names = shown(mortal_viewer, run.path)
    assert any(name.startswith("Mesh") for name in names)
    assert {"Reprojection error, px", "Milliseconds per stage", "Events", "Configuration", "Summary"} <= names
    early, late = shot(mortal_viewer, "Mesh", 0), shot(mortal_viewer, "Mesh", 30)
    for picture in (early, late):
        assert (picture.max(axis=2) > 120).mean() > 0.05  # the mesh is there
    assert np.abs(early.astype(int) - late).max() > 60
    assert [view.reports for view in mortal_viewer.client.get_state().views if view.reports] == []


@pytest.mark.slow
def test_two_recordings_side_by_side(mortal_viewer: Viewer, tmp_path: Path) -> None:
    first = write_run(tmp_path / "first.rrd", frames=FRAMES, unsure=False)
    second = write_run(tmp_path / "second.rrd", frames=FRAMES // 2, unsure=False)
    names = shown(mortal_viewer, first.path, second.path)
    assert {"Mesh: first", "Mesh: second", "Video: first", "Video: second", "Share of points seen"} <= names
    for side in ("first", "second"):
        mesh, video = shot(mortal_viewer, f"Mesh: {side}", 10), shot(mortal_viewer, f"Video: {side}", 10)
        assert (mesh.max(axis=2) > 120).mean() > 0.05
        assert (video.max(axis=2) > 120).mean() > 0.2  # and the picture
        for color in CORNERS_BGR:
            assert (np.abs(mesh.astype(int) - color).max(axis=2) < 12).any()
            assert (np.abs(video.astype(int) - color).max(axis=2) < 12).any()
    assert [view.reports for view in mortal_viewer.client.get_state().views if view.reports] == []
