"""How far tracked points are from the truth."""

from pathlib import Path

import numpy as np
import pytest

from app.bench.drift import drift_px
from tracking.tracks import Tracks


@pytest.mark.parametrize("off_px", [0.0, 0.5])
def test_points_that_slide_drift(tmp_path: Path, off_px: float) -> None:
    rng = np.random.default_rng(3)
    start = rng.uniform(100, 400, (2, 60))
    bent = np.array([[1.0, 0.2], [-0.1, 0.9]])
    true = np.stack([start, bent @ start, bent @ start + 30.0])
    W = true + np.array([0.0, 1.0, 1.0])[:, None, None] * np.array([[off_px], [0.0]])
    visible = rng.random((3, 60)) < 0.9
    with (tmp_path / "tracks.npz").open("wb") as file:
        Tracks(W, visible).save(file)
    S = np.concatenate([true, np.ones((3, 1, 60))], axis=1)
    np.savez(tmp_path / "truth.npz", W_px=true, S_gt=S, gt_frames=np.arange(3))
    assert drift_px(tmp_path / "tracks.npz", tmp_path / "truth.npz") == pytest.approx(off_px, abs=1e-9)
