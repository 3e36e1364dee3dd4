"""Degraded copies: the truth stays where the picture shows it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.files.track_file import load_truth
from app.footage.case import write
from app.footage.catalog import CASES
from app.footage.clip import Clip
from app.footage.storage import Storage
from tracking.video import Video

FRAMES, EVERY, SIZE = 100, 4, (320, 240)
K = np.array([[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]])
GEOMETRY = ("leaves the picture, half", "every third frame, from 1", "pixels 4:3", "mirrored", "turned by 50° at the start",
            "black at first", "an image missing")  # fmt: skip


@pytest.fixture(scope="module")
def dots(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    """White dots that wander, on black."""
    folder = tmp_path_factory.mktemp("dots")
    x, y = np.meshgrid(np.linspace(-40, 40, 4), np.linspace(-30, 30, 3))
    S = np.stack(
        [[x.ravel() + 20 * np.sin(f / 20), y.ravel(), np.full(12, 200.0 + 0.3 * x.ravel())] for f in range(FRAMES)]
    )
    W = K @ S
    W = W[:, :2] / W[:, 2:]

    def picture(frame: int) -> np.ndarray:
        image = np.zeros((*SIZE[::-1], 3), np.uint8)
        for point in W[frame].T:
            cv2.circle(image, tuple(np.rint(point * 8).astype(int).tolist()), 5 * 8, (255, 255, 255), -1, cv2.LINE_AA, 3)
        return image

    video = Storage().write(folder, map(picture, range(FRAMES)))
    shown = np.arange(0, FRAMES, EVERY)
    np.savez(folder / "truth.npz", W_px=W[shown], S_gt=S[shown], gt_frames=shown, K=K)
    return Clip(Path(video), folder / "truth.npz", (60, 50, 200, 140), FRAMES)


@pytest.mark.parametrize("name", GEOMETRY)
def test_the_truth_is_where_the_picture_shows_it(dots: Clip, tmp_path: Path, name: str) -> None:
    copy = write(dots, CASES[name], tmp_path)
    truth = load_truth(copy.truth)
    assert truth.K is not None
    image = truth.K @ truth.S
    assert np.allclose(image[:, :2] / image[:, 2:], truth.W_px)
    with Video(copy.source) as video:
        pictures = {frame.index: frame.image for frame in video}
        size = np.array(video.size)
    looked_at = 0
    for frame, W in zip(truth.frames, truth.W_px, strict=True):
        inside = ((W > 2) & (size[:, None] - 3 > W)).all(axis=0)
        if int(frame) in pictures:
            x, y = np.rint(W[:, inside]).astype(int)
            assert (pictures[int(frame)][y, x] > 150).all()
            looked_at += int(inside.sum())
    assert looked_at > 50
    assert copy.roi is not None
    x, y, w, h = copy.roi
    assert min(x, y) >= 0
    assert ((x + w, y + h) <= size).all()


def test_the_same_case_gives_the_same_copy(dots: Clip, tmp_path: Path) -> None:
    copies = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        with Video(write(dots, CASES["a thing crosses fast"], tmp_path / name).source) as video:
            copies.append(np.stack([frame.image for frame in video]))
    assert (copies[0] == copies[1]).all()
