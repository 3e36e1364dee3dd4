"""Whole videos through the pipeline: paper, talking face (paper's Figs. 5 and 6), and the program's own sample."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from app.demo import sample as made_sample
from app.options.model import Model
from app.options.run import Output, Run
from app.pipeline.session import Session
from app.playback.playback import Playback
from app.reproduce.chart import Panel, Series, charts
from app.reproduce.experiment import Experiment
from app.reproduce.part import Part
from app.reproduce.result import Headline, Result, Table, percent
from app.reproduce.strip import strip
from app.reproduce.work import Effort, Trial, Work
from app.terminal.errors import in_a_line
from reconstruction import ReconstructionError

PAPER_VIDEO, PAPER_TRUTH, FACE_VIDEO = "kinect_paper.mp4", "kinect_paper_gt.npz", "talking_face.mp4"
PAPER_FRAMES, PAPER_FOCAL_PX = 113, 528.0
FACE_FRAMES = 600
COLUMNS = (
    *(
        "focal length px",
        "frames",
        "points",
        "seen %",
        "reprojection px",
        "e3d %",
        "camera",
        "sign free",
        "rest shape alone",
    ),
    "fps",
)


@dataclass(frozen=True)
class Footage:
    """A video that is run.

    Attributes:
        name: what it is called.
        run: the command; sources relative to the data folder.
        focals: focal lengths it is run with; None says nothing.
        ours: whether its pictures may be published.
    """

    name: str
    run: Run
    focals: tuple[float | None, ...] = (None,)
    ours: bool = False


def filmed(work: Work, footage: Footage) -> Result:
    """A run for every focal length; of the first the strip and the error over the frames."""
    rows, headlines, remarks = [], [], []
    playback = None
    for n, focal in enumerate(footage.focals):
        path = work.scratch / f"{footage.name.replace(' ', '-')}-{n}.rrd"
        output = Output(out=path, overwrite=True)
        run = replace(footage.run, model=Model(focal=focal), output=output)
        try:
            trial = Trial(Session(run, Part(partial(work.step, 1 / expected_frames(run)))).run().as_dict())
        except ReconstructionError as error:
            trial = Trial({}, in_a_line(error))
            remarks.append(f"{trial.failure}.")
        e3d, static = percent(trial["e3d"]), percent(trial["e3d_static"])
        rows.append(
            (
                "not given" if focal is None else f"{focal:g}",
                trial.words.get("frames"),
                trial.words.get("points"),
                percent(trial["visible_share"]),
                trial["reprojection_rms_px"],
                e3d,
                percent(trial["e3d_camera"]),
                percent(trial["e3d_sign_free"]),
                static,
                trial["fps"],
            )
        )
        setting = "no focal length given" if focal is None else f"focal length {focal:g} px"
        headlines.append(Headline(f"{footage.name}, video", setting, e3d, static))
        playback = playback or (None if trial.failure else Playback.load(path))
    table = Table(footage.name, COLUMNS, rows)
    if playback is None:
        return Result([table], remarks=remarks)
    stem = footage.name.replace(" ", "-")
    figures, pictures = {f"{stem}-error.png": error_chart(playback, footage.name)}, {f"{stem}.jpg": strip(playback)}
    if footage.ours:
        return Result([table], figures | pictures, remarks=remarks, headlines=headlines)
    return Result([table], figures, pictures, remarks, [h for h in headlines if h.e3d is not None])


def expected_frames(run: Run) -> int:
    """Frames of a run whose range is closed, or those of the sample."""
    first, stop = run.frame_range
    return (stop or 300) - first


def error_chart(playback: Playback, name: str) -> bytes:
    """Reprojection error and share of the points seen, over the frames."""
    rms = [None] * len(playback.frames)
    for i in range(len(playback.frames)):
        estimate = playback.estimate(i)
        if estimate is not None and estimate.visible.any():
            rms[i] = float(np.sqrt(np.nanmean(estimate.residual_px**2)))  # type: ignore[call-overload]
    frames = playback.frames.tolist()
    seen = [Series("seen", frames, list(100 * playback.visible.mean(axis=1)), 2)]
    return charts(
        [
            Panel(f"Reprojection error: {name}", "frame", "RMS, px", [Series("error", frames, rms)]),
            Panel("Points seen", "frame", "%", seen, top=102),
        ]
    )


def paper(work: Work) -> Result:
    """The printed sheet, with its focal length and without."""
    frames = 40 if work.effort.quick else PAPER_FRAMES
    run = Run(
        str(work.data / PAPER_VIDEO),
        roi=(195, 95, 325, 265),
        frames=f"0:{frames}",
        points=300 if work.effort.quick else 800,
        ground_truth=work.data / PAPER_TRUTH,
    )
    return filmed(work, Footage("kinect_paper", run, (PAPER_FOCAL_PX, None)))


def talking_face(work: Work) -> Result:
    """The talking face, of which there is no truth."""
    frames = 40 if work.effort.quick else FACE_FRAMES
    run = Run(str(work.data / FACE_VIDEO), roi=(115, 70, 130, 160), frames=f"0:{frames}")
    return filmed(work, Footage("talking face", run))


def sample(work: Work) -> Result:
    """The program's own sample."""
    made = made_sample()
    run = Run(str(made.video), roi=made.roi, ground_truth=made.truth, frames="0:40" if work.effort.quick else "0:300")
    return filmed(work, Footage("sample", run, ours=True))


def one(_effort: Effort) -> int:
    """A run."""
    return 1


def two(_effort: Effort) -> int:
    """Runs."""
    return 2


PAPER = Experiment("paper", "A bending sheet of paper", paper, two, 12.0, (PAPER_VIDEO, PAPER_TRUTH), "Fig. 5")
TALKING_FACE = Experiment("talking-face", "A talking face", talking_face, one, 30.0, (FACE_VIDEO,), "Fig. 6")
SAMPLE = Experiment("sample", "The sample video", sample, one, 30.0)
