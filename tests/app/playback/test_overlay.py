"""Videos of a recording: every frame with its points, and the mesh over it."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.playback.overlay import enlarged
from app.recording.styles import PREDICTED_RGB, SEEN_RGB
from tests.app.exported import FRAMES, exported
from tests.synthetic_run import SIZE, Run


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("kind", ["mp4", "webm"])
def test_videos_show_every_frame_with_its_points(tmp_path: Path, run: Run, kind: str) -> None:
    video = cv2.VideoCapture(str(exported(run.path, kind, tmp_path)))
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(30, abs=0.01)
    pictures = []
    while (frame := video.read())[0]:
        pictures.append(frame[1])
    assert len(pictures) == FRAMES
    assert pictures[0].shape[1::-1] == enlarged(SIZE)
    scale = enlarged(SIZE)[0] / SIZE[0]
    observation, estimate = run.observations[1], run.estimates[1]

    def near(places_px: NDArray[np.float64], color: tuple[int, int, int]) -> float:
        x, y = np.rint((places_px + 0.5) * scale - 0.5).astype(int).T
        return float(np.mean(np.abs(pictures[1][y, x].astype(int) - color[::-1]).max(axis=1) < 70))

    seen = observation.visible
    assert near(observation.points_px[seen], SEEN_RGB) > 0.9
    assert near(estimate.projection_px[~seen], PREDICTED_RGB) > 0.9
    assert near(observation.points_px[seen], PREDICTED_RGB) < 0.1


def test_an_overlay_is_still_the_frame_away_from_the_mesh(tmp_path: Path, run: Run) -> None:
    video = cv2.VideoCapture(str(exported(run.path, "mp4", tmp_path)))
    image = video.read()[1]
    assert np.abs(image[: image.shape[0] // 10].astype(int) - run.picture[0, 0]).max() < 12
