"""Pictures of a running viewer."""

import time
from contextlib import suppress

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.viewer.conftest import Viewer

SETTLE_S = 20.0
PATIENCE = 6  # times its own deadline of some seconds a busy machine may take to draw


def shot(viewer: Viewer, name: str, frame: int) -> NDArray[np.uint8]:
    """(h, w, 3) BGR picture of the view whose name starts like this, at a frame."""
    viewer.client.set_time("frame", sequence=frame, play_state="paused")
    [view] = [view for view in viewer.client.get_state().views if view.name.startswith(name)]
    return steady(viewer, view.view_id)


def steady(viewer: Viewer, view_id: str | None = None) -> NDArray[np.uint8]:
    """(h, w, 3) BGR picture of a view, or of the whole window, once two are equal."""
    taken(viewer, view_id)  # the first one may be of a half-loaded scene
    picture, before = b"", b"-"
    end = time.monotonic() + SETTLE_S
    while picture != before and time.monotonic() < end:
        time.sleep(0.2)
        picture, before = taken(viewer, view_id), picture
    decoded = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    return np.asarray(decoded, np.uint8)


def taken(viewer: Viewer, view_id: str | None) -> bytes:
    """A picture as a file, whenever it comes."""
    for _ in range(PATIENCE - 1):
        with suppress(TimeoutError):
            return viewer.client.take_screenshot(view_id)
    return viewer.client.take_screenshot(view_id)
