"""The beating organ reconstructed with the paper's settings: general, r = 10, D_M (Fig. 7)."""

import numpy as np

from app.arrays import Array
from app.options.evaluate import Evaluate
from app.options.model import Model
from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.experiments.organ import NOISE_PX, POINTS, REST_FRAMES, organ_tracks
from app.reproduce.experiments.organ_picture import organ_picture
from app.reproduce.result import Headline, Result, Table, percent
from app.reproduce.work import Effort, Trial, Work
from reconstruction.evaluation import e3d
from tracking.tracks import Tracks

MODES = 10
METRICS = ("manhattan", "euclidean")  # the paper's first


def points(effort: Effort) -> int:
    """Number of points."""
    return 300 if effort.quick else POINTS


def beating_organ(work: Work) -> Result:
    """Both distances, and of the paper's the error over the frames and pictures of the shapes."""
    frames = 40 if work.effort.quick else 110
    tracks = organ_tracks(frames, points(work.effort))
    path, shapes_out = work.scratch / "organ.npz", work.scratch / "organ-shapes.npz"
    with path.open("wb") as file:
        tracks.save(file)
    trials: list[Trial] = []
    for metric in METRICS:
        model = Model(modes=MODES, metric=metric, deformation="general", bootstrap_frames=REST_FRAMES)  # type: ignore[arg-type]
        out = shapes_out if metric == METRICS[0] else None
        trials.append(work.evaluated(Evaluate(path, rest_shape="rigid", shapes_out=out, model=model)))
    columns = (
        "distance",
        "points",
        "frames",
        "modes",
        "e3d %",
        "camera",
        "rest shape alone",
        "reprojection px",
        "ms/frame",
    )
    rows = [
        (
            metric,
            points(work.effort),
            frames,
            MODES,
            *(percent(trial[name]) for name in ("e3d", "e3d_camera", "e3d_static")),
            trial["reprojection_rms"],
            trial["ms_per_frame"],
        )
        for metric, trial in zip(METRICS, trials, strict=True)
    ]
    title = f"An organ that beats, seen in perspective with {NOISE_PX} px of noise; rest shape from {REST_FRAMES} frames"
    table = Table(title, columns, rows)
    first = trials[0]
    if first.failure:
        return Result([table], remarks=[f"{first.failure}."])
    setting = f"general, r = {MODES}, D_M, {points(work.effort)} points"
    headline = Headline("synthetic beating organ", setting, percent(first["e3d"]), percent(first["e3d_static"]))
    with np.load(shapes_out) as saved:
        S, faces, rest = saved["S"], saved["faces"], saved["rest"]
    figures = {"organ-error.png": error_chart(S, rest, tracks), "organ.png": organ_picture(S, tracks, faces)}
    return Result([table], figures, headlines=[headline])


def error_chart(S: Array, rest: Array, tracks: Tracks) -> bytes:
    """Error over the frames, of the shapes and of the rest shape alone."""
    assert tracks.S_gt is not None
    frames = list(range(len(S)))
    still = np.broadcast_to(rest, S.shape)
    series = [
        Series("reconstructed", frames, list(100 * e3d(S, tracks.S_gt))),
        Series("rest shape alone", frames, list(100 * e3d(still, tracks.S_gt)), 1, dashed=True),
    ]
    return charts([Panel("Beating organ", "frame", "e3d, %", series)])


def steps(_effort: Effort) -> int:
    """One a distance."""
    return len(METRICS)


EXPERIMENT = Experiment("organ", "A beating, extensible organ", beating_organ, steps, 5.0, paper="Fig. 7")
