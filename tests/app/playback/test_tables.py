"""Tables of a recording: equal to what the run had."""

import csv
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from app.playback.playback import Playback
from app.playback.tables import write_npz
from tests.app.exported import FRAMES, exported
from tests.synthetic_run import Run


@pytest.mark.parametrize("which", ["run", "orthographic"])
def test_npz_is_what_the_run_had(tmp_path: Path, which: str, request: pytest.FixtureRequest) -> None:
    run: Run = request.getfixturevalue(which)
    with np.load(exported(run.path, "npz", tmp_path)) as stored:
        values = dict(stored)
    for key, name in (
        ("S", "shape"),
        ("R", "R"),
        ("s", "s"),
        ("t", "t"),
        ("Lambda", "Lambda"),
        ("visible", "visible"),
        ("sigma", "sigma"),
    ):
        expected = np.stack([getattr(estimate, name) for estimate in run.estimates])
        assert values[key] == pytest.approx(expected, rel=1e-9, abs=1e-6), key
    assert np.array_equal(values["faces"], run.mesh.faces)
    assert np.array_equal(values["frames"], np.arange(FRAMES))
    assert np.array_equal(np.isfinite(values["W"][:, 0]), values["visible"])
    projected = np.stack([e.projection_px.T for e in run.estimates])
    assert values["projection"] == pytest.approx(projected, abs=1e-6)
    if run.camera.perspective:  # seen from its place, in its axes, the object is where the camera has it
        k = 2
        turned = values["camera_R"][k].T @ (run.basis.deform(values["Lambda"][k]) - values["camera_position"][k][:, None])
        assert turned == pytest.approx(run.estimates[k].shape, abs=1e-6)
    else:
        assert np.isnan(values["camera_position"]).all()


def test_npz_has_empty_rows_where_the_surface_was_lost(run: Run) -> None:
    playback = Playback.load(run.path)
    s, quaternion, visible = playback.estimates.s.copy(), playback.estimates.quaternion.copy(), playback.visible.copy()
    s[3], quaternion[3], visible[3] = np.nan, np.nan, False
    phases = [*playback.phases[:3], "lost", *playback.phases[4:]]
    file = BytesIO()
    estimates = replace(playback.estimates, s=s, quaternion=quaternion)
    write_npz(replace(playback, estimates=estimates, visible=visible, phases=phases), file, lambda: None)
    with np.load(BytesIO(file.getvalue())) as stored:
        assert stored["frames"].tolist() == list(range(FRAMES))
        for key in ("S", "R", "s", "projection", "camera_R", "camera_position"):
            assert [bool(np.isnan(row).all()) for row in stored[key]] == [k == 3 for k in range(FRAMES)], key
        assert not stored["visible"][3].any()


def read(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_csv_has_points_poses_and_coefficients(tmp_path: Path, run: Run) -> None:
    folder = exported(run.path, "csv", tmp_path)
    points, p = read(folder / "points.csv"), len(run.pixels)
    assert len(points) == FRAMES * p
    for frame, point in ((1, 0), (1, 1), (4, 3)):
        row = points[frame * p + point]
        assert (int(row["frame"]), int(row["point"])) == (frame, point)
        estimate, observation = run.estimates[frame], run.observations[frame]
        assert bool(int(row["visible"])) == observation.visible[point]
        assert (row["observed_x"] == "") == (not observation.visible[point])
        assert float(row["projected_x"]) == pytest.approx(estimate.projection_px[point, 0], rel=1e-6)
        xyz = [float(row[axis]) for axis in "xyz"]
        assert xyz == pytest.approx(estimate.shape[:, point], rel=1e-6)
        assert float(row["sigma"]) == pytest.approx(estimate.sigma[point])
    frames, coefficients = read(folder / "frames.csv"), read(folder / "lambda.csv")
    assert [row["phase"] for row in frames] == ["bootstrap"] * 2 + ["tracking"] * 4
    assert float(frames[3]["qw"]) == pytest.approx(run.estimates[3].quaternion[0])
    center = -run.estimates[3].R.T @ [*run.estimates[3].t, run.camera.focal_px]
    assert [float(frames[3][f"camera_{axis}"]) for axis in "xyz"] == pytest.approx(center, rel=1e-6, abs=1e-5)
    assert float(coefficients[5]["tau_2"]) == pytest.approx(run.estimates[5].Lambda[2, 1])
    assert len(read(folder / "mesh.csv")) == len(run.mesh.faces)
