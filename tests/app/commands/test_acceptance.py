"""The figures the program promises, on real sequences with ground truth and on its own sample."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

from tests.app.command_line import Command
from tests.synthetic_run import verify

FLAG = ("flag250.npz", "--rest-shape", "first-truth", "--metric", "euclidean", "--modes", 20, "--deformation", "bending")
FLAG_PERSPECTIVE = ("flag250_perspective.npz", "--rest-shape", "first-truth", "--deformation", "inextensible")
FACE = ("face37.npz", "--rest-shape", "rigid", "--modes", 30, "--deformation", "general")
KINECT = ("--roi", 195, 95, 325, 265, "--frames", "0:113")


@pytest.mark.parametrize(
    ("arguments", "bound", "static"),
    [
        (FLAG, 0.029, 0.065),
        ((*FLAG, "--missing", 0.4, "--seed", 0), 0.031, 0.065),
        ((*FLAG, "--missing", 0.8, "--seed", 0), 0.040, 0.065),
        ((*FLAG[:-1], "auto"), 0.029, 0.065),
        ((*FLAG, "--noise", 0.01, "--seed", 0), 0.035, 0.065),
        (("flag250.npz", "--rest-shape", "rigid", "--bootstrap-frames", 15), 0.035, None),
        (FACE, 0.0245, 0.064),
        ((*FACE, "--missing", 0.4, "--seed", 0), 0.0288, 0.065),
        (FLAG_PERSPECTIVE, 0.022, 0.065),
        pytest.param((*FLAG_PERSPECTIVE, "--missing", 0.4, "--seed", 0), 0.025, 0.065, marks=pytest.mark.slow),
    ],
    ids=[
        "flag",
        "flag-missing",
        "flag-mostly-missing",
        "flag-auto",
        "flag-noise",
        "flag-rigid",
        "face",
        "face-missing",
        "flag-perspective",
        "flag-perspective-missing",
    ],
)
def test_evaluate(modeshape: Command, shared_data: Path, arguments: tuple[object, ...], bound: float, static) -> None:  # type: ignore[no-untyped-def]
    file, *options = arguments
    outcome = modeshape("evaluate", shared_data / str(file), *options, "--json")
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["e3d"] <= bound
    assert words["e3d"] <= words["e3d_camera"] < 3 * bound
    if static is not None:
        assert words["e3d_static"] == pytest.approx(static, abs=0.001)


@pytest.mark.parametrize(
    ("file", "bound"),
    [
        ("flag250.npz", 0.064),
        ("flag250_perspective.npz", 0.0155),
        pytest.param("waving_3.npz", 0.0043, marks=pytest.mark.slow),
        pytest.param("waving_5.npz", 0.006, marks=pytest.mark.slow),
        pytest.param("waving_7.npz", 0.0055, marks=pytest.mark.slow),
        pytest.param("waving_9.npz", 0.007, marks=pytest.mark.slow),
    ],
)
def test_sheets_that_are_never_flat(modeshape: Command, shared_data: Path, file: str, bound: float) -> None:
    outcome = modeshape("evaluate", shared_data / file, "--json")
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["rest_shape"] == "isometric"
    assert words["e3d"] <= bound
    assert words["e3d_online"] >= words["e3d"]  # the same where they end before first frames have told


@pytest.mark.slow
def test_a_printed_sheet_that_is_bent_from_the_start_on(modeshape: Command, shared_data: Path) -> None:
    outcome = modeshape(
        "run", shared_data / "kinect_paper.mp4", *KINECT[:-1], "60:113", "--json", "--out", "paper.rrd",
        "--ground-truth", shared_data / "kinect_paper_gt.npz",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["e3d"] <= 0.018
    assert words["focal_px"] == pytest.approx(528, rel=0.03)


@pytest.mark.parametrize(
    ("option", "share", "factor"),
    [
        ("--missing", 0.2, 1.1),
        ("--missing", 0.4, 1.2),
        ("--missing", 0.6, 1.4),
        ("--missing", 0.8, 2.0),
        ("--outliers", 0.1, 1.3),
    ],
)
@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_missing_points_and_outliers_cost_little(
    modeshape: Command, shared_data: Path, option: str, share: float, factor: float, seed: int
) -> None:
    outcome = modeshape("evaluate", shared_data / FLAG[0], *FLAG[1:], option, share, "--seed", seed, "--json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["e3d"] <= factor * 0.0277


@pytest.mark.parametrize(("share", "missing", "factor"), [(0.1, 0.0, 1.2), (0.2, 0.0, 1.4), (0.1, 0.4, 1.4)])
@pytest.mark.parametrize("seed", [0, pytest.param(3, marks=pytest.mark.slow)])
def test_a_solid_recovered_among_outliers_costs_little(
    modeshape: Command, shared_data: Path, share: float, missing: float, factor: float, seed: int
) -> None:
    outcome = modeshape(
        "evaluate", shared_data / FACE[0], *FACE[1:], "--outliers", share, "--missing", missing, "--seed", seed, "--json"
    )
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["e3d"] <= factor * 0.030


def test_more_modes_explain_more(modeshape: Command, shared_data: Path) -> None:
    errors = []
    for modes in (5, 10, 20, 30):
        outcome = modeshape("evaluate", shared_data / "face37.npz", *FACE[1:3], "--modes", modes, *FACE[5:], "--json")
        errors.append(json.loads(outcome.out)["e3d"])
    assert errors[-1] < 0.75 * errors[0]
    assert all(b < a + 0.001 for a, b in itertools.pairwise(errors))


@pytest.mark.parametrize(
    ("focal", "bound"),
    [pytest.param((), 0.0178, id="found"), pytest.param(("--focal", 528), 0.0178, id="true", marks=pytest.mark.slow)],
)
def test_a_printed_sheet_is_followed(
    modeshape: Command, shared_data: Path, here: Path, focal: tuple[object, ...], bound: float
) -> None:
    outcome = modeshape(
        "run", shared_data / "kinect_paper.mp4", *KINECT, *focal, "--json", "--out", "paper.rrd",
        "--ground-truth", shared_data / "kinect_paper_gt.npz", "--tracks-out", "tracks.npz",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["frames"] == 113
    assert words["points"] >= 400
    with np.load("tracks.npz") as tracks:
        assert tracks["visible"][112].mean() >= 0.6
    assert words["reprojection_rms_px"] <= 2
    assert words["e3d"] <= bound
    assert words["e3d"] < words["e3d_online"] < 0.03
    assert words["e3d_static"] > 0.1
    assert words["focal_px"] == pytest.approx(528, rel=0.03)
    assert words["truth_points"] >= 250
    assert words["truth_frames"] == 14
    verify(here / "paper.rrd")


@pytest.mark.slow
def test_a_talking_face_is_followed(modeshape: Command, shared_data: Path, here: Path) -> None:
    outcome = modeshape(
        "run", shared_data / "talking_face.mp4", "--roi", 115, 70, 130, 160, "--frames", "0:100", "--json",
        "--out", "face.rrd", "--shapes-out", "shapes.npz",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["frames"] == 100
    assert words["visible_share"] > 0.8
    assert words["reprojection_rms_px"] < 3
    with np.load("shapes.npz") as shapes:
        image = shapes["K"] @ shapes["S"]
    image = image[:, :2] / image[:, 2:]
    centre, size = image.mean(axis=2), image.std(axis=2)
    # In these frames the head stays within half its size of where it was.
    assert np.abs(centre - centre[0]).max() < 40
    assert (size / size[0]).min() > 0.7
    assert (size / size[0]).max() < 1.3
    verify(here / "face.rrd")


@pytest.mark.slow  # the gate tries it with the wheel
def test_demo(modeshape: Command, here: Path) -> None:
    outcome = modeshape("demo", "--json")
    assert outcome.code == 0, outcome.err
    words = json.loads(outcome.out)
    assert words["frames"] >= 240
    assert words["e3d"] <= 0.05
    assert words["e3d"] <= 0.5 * words["e3d_static"]
    assert words["recording"] == "recordings/demo.rrd"
    verify(here / "recordings" / "demo.rrd")
