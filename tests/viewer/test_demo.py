"""The sample video with a picture on its mesh, as `modeshape run --texture` records it, in the real viewer."""

import time

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app import demo
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.recording import entities
from app.terminal.progress import Progress
from tests.viewer.conftest import Viewer
from tests.viewer.screenshot import SETTLE_S, shot

pytestmark = pytest.mark.viewer

LAST = 120
EYE = np.array([0.9, -0.65, -4.2])  # of the blueprint; it looks at the origin, −y is up
FIELD_OF_VIEW_DEGREES = 55.0  # the viewer's own, from bottom to top
QUARTERS_BGR = np.array([[(30, 30, 220), (40, 190, 40)], [(220, 60, 30), (30, 210, 220)]], np.uint8)


@pytest.fixture(scope="module")
def playback(viewer: Viewer, tmp_path_factory: pytest.TempPathFactory) -> Playback:
    folder, made = tmp_path_factory.mktemp("textured"), demo.sample()
    texture, path = folder / "quarters.png", folder / "textured.rrd"
    cv2.imwrite(str(texture), cv2.resize(QUARTERS_BGR, (400, 300), interpolation=cv2.INTER_NEAREST))
    options = {"roi": made.roi, "frames": f":{LAST + 1}", "texture": texture}
    Session(Run(str(made.video), **options, output=Output(out=path)), Progress()).run()  # type: ignore[arg-type]
    viewer.client.open(str(path))
    end = time.monotonic() + SETTLE_S
    while viewer.client.get_state().loading and time.monotonic() < end:
        time.sleep(0.1)
    return Playback.load(path)


def on_screen(playback: Playback, row: int, size: tuple[int, int]) -> NDArray[np.float64]:
    """Where the vertices (p, 2) of a frame are in a picture (width, height) of the 3-D view."""
    shape = playback.shapes()[row]
    moved = playback.file.rows((entities.MESH, "Transform3D:scale"), (entities.MESH, "Transform3D:translation"))
    scale, translation = (
        np.reshape(moved.static(entities.MESH, f"Transform3D:{part}"), 3) for part in ("scale", "translation")
    )
    forward = -EYE / np.linalg.norm(EYE)
    right = np.cross(forward, (0.0, -1.0, 0.0))
    right /= np.linalg.norm(right)
    seen = (scale * shape.T + translation - EYE) @ np.stack([right, np.cross(forward, right), forward]).T
    focal_px = size[1] / 2 / np.tan(np.deg2rad(FIELD_OF_VIEW_DEGREES) / 2)
    return np.asarray(seen[:, :2] / seen[:, 2:] * focal_px + np.array(size) / 2)


@pytest.mark.parametrize("frame", [0, LAST])
def test_vertices_have_the_texture_s_colour(viewer: Viewer, playback: Playback, frame: int) -> None:
    picture = shot(viewer, "Mesh", frame)
    assert [view.reports for view in viewer.client.get_state().views if view.reports] == []
    x, y = np.rint(on_screen(playback, frame, picture.shape[1::-1])).astype(int).T
    low, high = playback.texture_px.min(axis=0), playback.texture_px.max(axis=0)
    place = (playback.texture_px - low) / (high - low)
    inner = (np.abs(place - 0.5) > 0.06).all(axis=1) & (np.abs(place - 0.5) < 0.44).all(axis=1)  # not on a border
    column, row = (place > 0.5).astype(int).T
    # In the scene's light: the hue is the texture's, the brightness the first frame's.
    seen, painted = picture[y, x].astype(float), QUARTERS_BGR[row, column].astype(float)
    cosine = (seen * painted).sum(axis=1) / np.linalg.norm(seen, axis=1) / np.linalg.norm(painted, axis=1)
    assert inner.sum() > 300
    assert cosine[inner].min() > 0.98
    assert np.linalg.norm(seen[inner], axis=1).min() > 100


def test_the_sheet_has_moved(viewer: Viewer, playback: Playback) -> None:
    assert playback.frames[-1] == LAST
    for name in ("Mesh", "Video"):
        first, later = shot(viewer, name, 0), shot(viewer, name, LAST)
        assert (np.abs(first.astype(int) - later).max(axis=2) > 30).mean() > 0.02, name
