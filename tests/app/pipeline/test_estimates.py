"""What --shapes-out holds when other models came on the way."""

from pathlib import Path

import numpy as np

from app.options.evaluate import Evaluate
from app.pipeline.evaluate import evaluate
from app.synthetic.scene import scene
from app.synthetic.tracks import USUAL, tracks
from app.terminal.progress import Progress


def test_poses_and_modes_are_those_of_the_model_that_is_written(tmp_path: Path) -> None:
    """Its first model has 20 modes, the next 40."""
    given, out = tmp_path / "tracks.npz", tmp_path / "shapes.npz"
    with given.open("wb") as file:
        tracks(scene("talking-head", 711, frames=75), USUAL).save(file)
    evaluate(Evaluate(given, final_pass=False, shapes_out=out), Progress())
    with np.load(out) as file:
        S, shapes = file["S"], file["R"] @ (file["rest"] + file["Phi"] @ file["Lambda"] @ file["Upsilon"])
    off = np.ptp(S - shapes, axis=2).max(axis=1)
    told = np.isfinite(off)
    assert np.isfinite(S).all()
    assert not told[0]
    assert told[-1]
    assert off[told].max() < 1e-6
